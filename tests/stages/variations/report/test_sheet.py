"""The contact sheet of a kit's variants."""

from __future__ import annotations

import io

import numpy as np
from PIL import Image

from stages.shape.sample import Sample
from stages.variations.report.sheet import kit_variants_sheet
from tests.stages.variations.search.test_search import search
from tests.toy_kits.chains_and_rings import ROAD, kit_of, ring


def test_a_sheet_has_rows_for_the_exemplars_the_first_chosen_and_some_of_the_rest() -> None:
    kit = kit_of(ROAD, [ring(1, 1), ring(2, 3)])
    _, found = search(kit, tries=300, largest=3.0)
    samples = [
        Sample(f"toy-{place:06d}", "train", "variations", kit.name, "", {}, found[place % len(found)].assembly)
        for place in range(30)
    ]
    whole = Image.open(io.BytesIO(kit_variants_sheet(kit, samples, "", np.random.default_rng(0))))
    first = Image.open(io.BytesIO(kit_variants_sheet(kit, samples[:24], "", np.random.default_rng(0))))
    few = Image.open(io.BytesIO(kit_variants_sheet(kit, samples[:3], "", np.random.default_rng(0))))
    assert whole.height > first.height > few.height
    assert whole.width == first.width > few.width


def test_of_a_dull_pool_each_of_the_first_stands_beside_the_exemplar_that_it_has_copied_most_of() -> None:
    kit = kit_of(ROAD, [ring(1, 1), ring(2, 3)])
    copied = {"largest": 1.0, "pieces": 1, "exemplar": 1.0, "of": kit.exemplars[1].name}
    samples = [
        Sample("toy-0", "train", "variations", kit.name, "", {"copied": copied}, exemplar.assembly)
        for exemplar in kit.exemplars
    ]

    def pictures(dull: str) -> np.ndarray:
        return np.array(Image.open(io.BytesIO(kit_variants_sheet(kit, samples, dull, np.random.default_rng(0)))))

    plain, dull = pictures(""), pictures("dull: alike")
    cell = plain.shape[1] // 2
    # Two samples become two pairs, and the second sample is its exemplar.
    assert dull.shape[1] > plain.shape[1] + cell
    ink = (dull != dull[0, 0]).any(axis=2).sum()
    assert ink > (plain != plain[0, 0]).any(axis=2).sum()
