"""Bays of modules: storeys and other bays are inserted and removed whole, whatever modules they hold."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
import trimesh

from stages.proportions.text import ProportionError, Proportions, ProportionShapes, proportion_text, read_proportions
from stages.rows.changes import change_json, changed, read_change
from stages.rows.draws import LayoutDraws
from stages.rows.kit_rows import rows_of_kit
from stages.rows.layout import Layout, layout_of
from stages.rows.modular_bays import ModularBay, find_modular_bays, with_modular_bays
from stages.rows.settings import RowsConfig
from stages.rows.slabs import RowChange, SlabError
from stages.shape.kit import Kit
from tests.stages.rows import models
from tests.stages.rows.soundness import assert_sound
from tests.toy_kits.chains_and_rings import ROAD, box, kit_of, pose, ring

UP_AXIS = 1


def storeys_of(layout: Layout) -> list[ModularBay]:
    """Return the bays of one storey that begin with its tiles."""
    found = [bay for bay in find_modular_bays(layout) if bay.end - bay.start == pytest.approx(1.0)]
    return [bay for bay in found if bay.end == pytest.approx(round(bay.end))]


def stated(bay: ModularBay, times: int) -> RowChange:
    change = bay.change(times)
    assert change is not None
    return change


def counts(kit: Kit, layout: Layout) -> Counter[str]:
    return Counter(kit.types[kind].label for kind in layout.types.tolist())


def test_storeys_with_other_openings_are_bays_although_there_are_no_rows() -> None:
    kit, layout = models.tower()
    assert not [row for row in rows_of_kit(kit) if not (row.is_mirrored or row.is_modular)]
    assert {bay.axis for bay in find_modular_bays(layout)} == {UP_AXIS}
    found = storeys_of(layout)
    assert [round(bay.end, 3) for bay in found] == [2.0, 3.0], "below the first is the ground, on the last the roof"
    assert all(len(bay.parts) == 8 and bay.count == 4 and bay.may_insert for bay in found)
    assert not find_modular_bays(layout, {0, 2})


@pytest.mark.parametrize("times", [1, 3])
def test_an_inserted_storey_is_the_same_storey_again_and_touches_its_neighbours(times: int) -> None:
    kit, layout = models.tower()
    bay = storeys_of(layout)[0]
    higher = with_modular_bays(layout, stated(bay, times))
    assert_sound(kit, higher)
    copied = Counter(kit.types[kind].label for kind in layout.types[bay.parts].tolist())
    added = Counter({label: times * count for label, count in copied.items()})
    assert counts(kit, higher) == counts(kit, layout) + added
    np.testing.assert_allclose(higher.extent - layout.extent, [0.0, times, 0.0], atol=1e-9)


def test_a_storey_is_removed_unless_it_holds_the_last_of_a_type() -> None:
    kit, layout = models.tower()
    bay = storeys_of(layout)[0]
    assert bay.may_remove
    lower = with_modular_bays(layout, stated(bay, -1))
    assert_sound(kit, lower)
    assert len(lower) == len(layout) - 8
    types = layout.types.copy()
    types[[storey.parts[0] for storey in storeys_of(layout)]] = [types.max() + 1, types.max() + 2]
    for kept in storeys_of(replace(layout, types=types)):
        assert kept.may_insert
        assert not kept.may_remove
        assert kept.change(-1) is None


def test_a_storey_with_a_door_is_inserted_only_where_none_without_one_can_be() -> None:
    kit, layout = models.tower(has_door=True)
    held = [Counter(kit.types[kind].label for kind in layout.types[bay.parts]) for bay in find_modular_bays(layout)]
    assert not any(labels["door"] for labels in held if labels["tile"] in (4, 8))
    assert all(labels["door"] for labels in held if labels["tile"] == 12), "three of four storeys hold it"


def test_modules_of_one_size_with_other_sections_are_not_interchangeable() -> None:
    kit, layout = models.zigzag_roof()
    found = find_modular_bays(layout)
    assert {round(bay.end - bay.start, 3) for bay in found} == {2.0}, "a rise and a fall together, not one of them"
    for bay in found:
        assert_sound(kit, with_modular_bays(layout, stated(bay, 1)))


def test_a_beam_that_no_module_stands_in_for_ends_no_bay_inside_it() -> None:
    """At 1 and 3 the section is the same, but the first beam ends at 1.5: between two bays would be a gap."""
    meshes = {"stone": box(1.0, 1.0, 1.0), "long": box(1.5, 0.5, 1.0), "short": box(1.0, 0.5, 1.0)}
    stones = [("stone", pose(number + 0.5, -0.5, 0.0)) for number in range(4)]
    beams = [("long", pose(0.75, 0.25, 0.0)), ("long", pose(2.25, 0.25, 0.0)), ("short", pose(3.5, 0.25, 0.0))]
    _, layout = models.layout(meshes, [*stones, *beams])
    assert (1.0, 3.0) not in [(round(bay.start, 3), round(bay.end, 3)) for bay in find_modular_bays(layout)]


def test_a_closed_road_gets_no_road_across_and_is_not_opened() -> None:
    kit = kit_of(ROAD, [ring(1, 1)], ("point", "line", "face"))
    assert not find_modular_bays(layout_of(kit, kit.exemplars[0]))


def test_a_part_in_two_pieces_fills_nothing_between_them() -> None:
    meshes = {"stone": box(1.0, 1.0, 1.0), "pair": box(1.0, 0.2, 1.0)}
    meshes["pair"] = trimesh.util.concatenate([meshes["pair"].copy().apply_translation([0, y, 0]) for y in (-1.4, 1.4)])
    stones = [("stone", pose(0.0, y, 0.0)) for y in (-1.0, 0.0, 1.0)]
    kit, layout = models.layout(meshes, [*stones, ("pair", pose(1.0, 0.0, 0.0))])
    found = find_modular_bays(layout)
    assert [(bay.axis, round(bay.end, 3)) for bay in found] == [(UP_AXIS, 0.5)]
    assert_sound(kit, with_modular_bays(layout, stated(found[0], 1)))


def test_draws_are_deterministic_keep_to_their_limits_and_json_keeps_them() -> None:
    kit, layout = models.tower(has_door=True)
    draws = LayoutDraws(layout, RowsConfig(), is_alone=True, up=UP_AXIS)
    drawn = [draws.draw(np.random.default_rng(seed)) for seed in range(20)]
    same = LayoutDraws(layout, RowsConfig(), is_alone=True, up=UP_AXIS)
    assert [made and made[1].key for made in drawn[:4]] == [
        made and made[1].key for made in (same.draw(np.random.default_rng(seed)) for seed in range(4))
    ]
    found = [result for result in drawn if result is not None]
    storeys = [(changes, made) for changes, made in found if changes[0].is_modular]
    tiles = {counts(kit, made)["tile"] // 4 for _, made in storeys}
    assert len(tiles) > 2
    assert tiles <= set(range(2, 9))
    changes, higher = storeys[0]
    read = layout
    for change in changes:
        read = changed(read, read_change(change_json(change)))
    assert read.key == higher.key
    assert not LayoutDraws(layout, RowsConfig()).can_change, "in a search, exchange finds them"


def test_a_text_says_the_bays_and_a_wrong_one_is_refused() -> None:
    kit, layout = models.tower()
    change = stated(storeys_of(layout)[0], 2)
    shapes, name = ProportionShapes(kit), kit.exemplars[0].name
    unwarped = shapes.unwarped(name, (change,))
    x, y, z = (np.ones(len(knots) - 1) for knots in unwarped.lattice.knots)
    text = proportion_text(Proportions(name, (x, y, z), (change,)))
    assert '"is_modular": true' in text
    again = shapes.unwarped(name, read_proportions(text).changes)
    assert again.assembly.edges.tolist() == unwarped.assembly.edges.tolist()
    with pytest.raises(ProportionError, match="cut in the same way"):
        shapes.unwarped(name, (replace(change, at=4.0),))
    with pytest.raises(SlabError, match="along an axis"):
        with_modular_bays(layout, replace(change, shift=np.array([0.0, 1.0, 1.0])))


def test_inspect_says_what_the_bays_hold() -> None:
    kit, _ = models.tower()
    (sentence,) = [row.sentence for row in rows_of_kit(kit) if row.is_modular]
    assert sentence == "bays of tile, vent, wall and more, along y"
