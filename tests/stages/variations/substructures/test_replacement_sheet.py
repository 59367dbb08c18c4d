"""The sheet of replacements shows what left, what came and what was made of them."""

from __future__ import annotations

import io
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from stages.shape.kit import Kit
from stages.shape.sample import Sample
from stages.variations.selection.orientation import vertical_turn
from stages.variations.substructures.replacement_sheet import (
    DrawnReplacement,
    known_shapes,
    replacement_of,
    replacements_sheet,
)
from tests.stages.variations.substructures.test_replacing import replaced
from tests.toy_kits.chains_and_rings import CHAIN, ROAD, chain, kit_of, ring


def samples_of(kit: Kit, turned: float = 0.0) -> list[Sample]:
    """What a short search finds, as a dataset has it."""
    _, found = replaced(kit, 600, max_repeats=1, max_size=3.0)
    turn = vertical_turn(1, turned)
    lineage_fields = {"turned_degrees": turned, "restored_hubs": 0}
    return [
        Sample(
            f"toy-{place}",
            "train",
            "variations",
            kit.name,
            "",
            {**variant.lineage, "made_of": variant.lineage["parents"], "name": f"test-{place}", **lineage_fields},
            replace(variant.assembly, poses=turn @ variant.assembly.poses),
        )
        for place, variant in enumerate(found)
    ]


def shown(kit: Kit, samples: list[Sample]) -> list[tuple[Sample, DrawnReplacement]]:
    known = known_shapes(kit, samples)
    lineage_fields = [(sample, replacement_of(kit, sample, known)) for sample in samples]
    return [(sample, found) for sample, found in lineage_fields if found is not None]


@pytest.mark.parametrize("turned", [0.0, 90.0])
@pytest.mark.parametrize("rings", [False, True])
def test_lineage_tells_which_parts_left_and_came(turned: float, rings: bool) -> None:
    kit = kit_of(ROAD, [ring(1, 1), ring(2, 3)]) if rings else kit_of(CHAIN, [chain(3), chain(5)])
    samples = samples_of(kit, turned)
    lineage_fields = shown(kit, samples)
    assert len(lineage_fields) == len(samples)
    for sample, found in lineage_fields:
        assert len(found.base[1]) - found.taken.sum() + found.piece.sum() == len(sample.assembly)
        assert found.piece.sum() == found.came.sum() == min(sample.lineage["parts_from"])
        assert found.taken.sum() == len(found.base[1]) - max(sample.lineage["parts_from"])
        stays = found.base[1].poses[~found.taken]
        gaps = np.abs(stays[:, None] - found.result.poses[~found.came]).max(axis=(2, 3)).min(axis=1)
        assert gaps.max() < kit.pose_tolerance


def test_replacement_is_known_only_if_its_parents_are_samples() -> None:
    kit = kit_of(CHAIN, [chain(3), chain(5)])
    samples = samples_of(kit)
    names = {exemplar.name for exemplar in kit.exemplars}
    later = [sample for sample in samples if not set(sample.lineage["made_of"]) <= names]
    assert later
    assert len(shown(kit, later)) < len(later)
    keys = {sample.key for sample in samples}
    assert any(found.base[0] in keys for _, found in shown(kit, samples))


def test_sheet_has_a_row_per_replacement() -> None:
    kit = kit_of(CHAIN, [chain(3), chain(5)])
    samples = [sample for sample, _ in shown(kit, samples_of(kit))]
    assert replacements_sheet(kit, []) is None
    heights = []
    for few in (samples[:1], samples[:2]):
        sheet = replacements_sheet(kit, few)
        assert sheet is not None
        picture = np.array(Image.open(io.BytesIO(sheet)))
        heights.append(picture.shape[0])
    assert heights[1] > heights[0]
