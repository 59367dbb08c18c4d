"""What is said to the user of a kit in which nothing is found: the advice can be taken, and what it names then ends."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

from stages.exemplars.build import build_kit
from stages.exemplars.settings import HubConfig
from stages.shape.kit import Kit
from stages.variations.report.advice import what_keeps
from stages.variations.requirements.hub_restoration import HUBS_NOT_RESTORED
from tests.toy_kits.chains_and_rings import CHAIN, Placed, box, chain, config_of, kit_of, models_of, pose

BLOCKS = {"a": box(1.0, 1.0, 1.0), "b": box(1.0, 1.0, 2.0), "c": box(1.0, 1.0, 3.0)}
ROW = [("a", pose(0, 0, 0)), ("b", pose(1, 0, 0)), ("c", pose(2, 0, 0))]


def row(types: str) -> Kit:
    """Three blocks of three lengths in a row; a and c are called alike."""
    (model,) = models_of(BLOCKS, [ROW])
    called = tuple(replace(part, label="middle" if part.mesh_name == "b" else "end") for part in model.parts)
    return build_kit(config_of([ROW]).model_copy(update={"types": types}), [replace(model, parts=called)])[0]


@pytest.mark.parametrize("types", ["congruence", "labels"])
def test_advised_types_key_merges_part_types(types: str) -> None:
    said = what_keeps(row(types), {}, 100)
    assert said.startswith("every part is its own type; ")
    (advised,) = re.findall(r"`types: (\w+)`", said)
    assert "own type" not in what_keeps(row(advised), {}, 100)


def test_small_shapes_need_more_models_or_types_by_meaning() -> None:
    said = what_keeps(kit_of(CHAIN, [chain(3), chain(5)]), {}, 100)
    assert said.startswith("of 7 parts hardly any can be exchanged; bring more models of the same parts")
    assert "`types: meaning`" in said


@pytest.mark.parametrize(
    ("shapes", "asked"), [([chain(14)], "bring a second"), ([chain(14), chain(15)], "bring another")]
)
def test_advice_asks_for_another_model(shapes: list[list[Placed]], asked: str) -> None:
    assert asked in what_keeps(kit_of(CHAIN, shapes), {}, 100)


def test_advice_names_hubs_that_were_not_restored() -> None:
    plate: Placed = ("plate", pose(1, -0.55, 0))
    meshes = {**CHAIN, "plate": box(4.5, 0.1, 3.0)}
    kit = kit_of(meshes, [[*chain(3), plate]], hubs=HubConfig(types=("plate",), restore=True))
    said = what_keeps(kit, {HUBS_NOT_RESTORED: 3}, 100)
    assert said == "everything found lacks plate, which `hubs.types` left out; bring a second model of the same parts"
