"""Required labels of a kit: those of parts that are as large as its exemplars."""

from __future__ import annotations

import pytest

from pipeline.errors import ConfigError
from stages.exemplars.settings import HubConfig
from stages.variations.requirements.required_labels import labels_test, spanning_hubs, spanning_labels
from tests.toy_kits.chains_and_rings import CHAIN, Placed, box, chain, kit_of, pose

MESHES = {"top": box(4.0, 0.2, 2.0), "leg": box(0.2, 2.0, 0.2), "shelf": box(3.2, 0.2, 1.5)}


def stand(*legs: tuple[float, float]) -> list[Placed]:
    """A top of a diagonal of 4.48 on legs, all in all 4.98 across."""
    return [("top", pose(0, 1.1, 0)), *(("leg", pose(x, 0, z)) for x, z in legs)]


FOUR = stand((-1.5, -0.5), (1.5, -0.5), (-1.5, 0.5), (1.5, 0.5))


def test_labels_of_spanning_parts_are_required() -> None:
    assert spanning_labels(kit_of(MESHES, [FOUR])) == ("top",)
    assert spanning_labels(kit_of(CHAIN, [chain(5)])) == ()


def test_spanning_label_spans_every_exemplar() -> None:
    shelf = ("shelf", pose(0, -1.1, 0))  # on the ground below the legs: 3.54 of 5.07 across
    both = kit_of(MESHES, [[*FOUR, shelf], FOUR])
    assert spanning_labels(kit_of(MESHES, [[*FOUR, shelf]])) == ("top", "shelf")
    assert spanning_labels(both) == ("top",)


def test_hubs_are_no_required_labels() -> None:
    table = [*FOUR, ("shelf", pose(0, -1.1, 0))]
    kit = kit_of(MESHES, [table])
    hub = kit_of(MESHES, [table], hubs=HubConfig(types=("top",)))
    assert spanning_labels(kit) == ("top", "shelf")
    assert spanning_labels(hub) == ("shelf",)
    assert spanning_hubs(hub) == {hub.type_names().index("top"): 1}
    assert spanning_hubs(kit) == {}


def test_spanning_hubs_are_counted_by_the_smallest_exemplar() -> None:
    sides: list[Placed] = [("side", pose(x, 0, 0)) for x in (-1.05, 1.05)]
    shelves: list[Placed] = [("board", pose(0, y, 0)) for y in (-0.1, 0.0, 0.1)]
    lining: Placed = ("side", pose(-1.15, 0, 0))
    meshes = {"side": box(0.1, 4.0, 2.0), "board": box(2.0, 0.1, 1.5)}
    kit = kit_of(meshes, [[*sides, *shelves], [*sides, *shelves, lining]], hubs=HubConfig(types=("side",)))
    assert spanning_hubs(kit) == {kit.type_names().index("side"): 2}


def test_required_labels_are_tested_and_wrong_names_reported() -> None:
    kit = kit_of(MESHES, [FOUR])
    whole = kit.exemplars[0].assembly
    legs = whole.select([part for part in range(len(whole)) if kit.types[whole.types[part]].name == "leg"])
    asked = labels_test(kit, ("top",))
    assert (asked(whole), asked(legs), labels_test(kit, ())(legs)) == (True, False, True)
    with pytest.raises(ConfigError, match=r"require\.labels: kit toy has no parts called tap; did you mean top\?"):
        labels_test(kit, ("top", "tap"))
