"""The sheet of replacements shows what left, what came and what was made of them."""

from __future__ import annotations

import io
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from stages.shape.kit import Kit
from stages.shape.sample import Sample
from stages.variations.facing import vertical_turn
from stages.variations.substructures.sheet import replaced_parts, replacements_sheet
from tests.stages.variations.substructures.test_replacing import replaced
from tests.stages.variations.toy import CHAIN, chain, kit_of


def samples_of(kit: Kit, turned: float = 0.0) -> list[Sample]:
    _, found = replaced(kit, 600, repeats=1)
    turn = vertical_turn(1, turned)
    return [
        Sample(
            f"toy-{place}",
            "train",
            "variations",
            kit.name,
            "",
            {**each.lineage, "made_of": each.lineage["parents"], "turned": turned},
            replace(each.assembly, poses=turn @ each.assembly.poses),
        )
        for place, each in enumerate(found)
    ]


@pytest.mark.parametrize("turned", [0.0, 90.0])
def test_the_parts_that_left_and_came_are_told_from_the_lineage(turned: float) -> None:
    kit = kit_of(CHAIN, [chain(3), chain(5)])
    told = [(each, replaced_parts(kit, each)) for each in samples_of(kit, turned)]
    known = [(sample, found) for sample, found in told if found is not None]
    assert known
    for sample, ((base, taken), (_, piece)) in known:
        assert len(base) - taken.sum() + piece.sum() == len(sample.assembly)
        assert piece.sum() == sample.lineage["parts_from"][0]
    names = {each.name for each in kit.exemplars}
    assert all(set(sample.lineage["made_of"]) <= names for sample, _ in known)


def test_a_sheet_has_a_row_for_each_replacement_and_is_not_made_of_none() -> None:
    kit = kit_of(CHAIN, [chain(3), chain(5)])
    samples = [each for each in samples_of(kit) if replaced_parts(kit, each) is not None]
    assert replacements_sheet(kit, []) is None
    heights = []
    for shown in (samples[:1], samples[:2]):
        sheet = replacements_sheet(kit, shown)
        assert sheet is not None
        picture = np.array(Image.open(io.BytesIO(sheet)))
        heights.append(picture.shape[0])
    assert heights[1] > heights[0]
