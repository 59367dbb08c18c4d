"""The contact sheet of a kit's variants."""

from __future__ import annotations

import io

import numpy as np
from PIL import Image

from stages.shape.sample import Sample
from stages.variations.report.sheet import kit_variants_sheet
from tests.stages.variations.search.test_search import search
from tests.toy_kits.chains_and_rings import ROAD, kit_of, ring


def test_sheet_shows_exemplars_first_selected_and_random_variants() -> None:
    kit = kit_of(ROAD, [ring(1, 1), ring(2, 3)])
    _, found = search(kit, tries=300, max_size=3.0)
    samples = [
        Sample(f"toy-{place:06d}", "train", "variations", kit.name, "", {}, found[place % len(found)].assembly)
        for place in range(30)
    ]
    whole = Image.open(io.BytesIO(kit_variants_sheet(kit, samples, "", np.random.default_rng(0))))
    first = Image.open(io.BytesIO(kit_variants_sheet(kit, samples[:24], "", np.random.default_rng(0))))
    few = Image.open(io.BytesIO(kit_variants_sheet(kit, samples[:3], "", np.random.default_rng(0))))
    assert whole.height > first.height > few.height
    assert whole.width == first.width > few.width


def test_sheet_of_low_diversity_shows_copied_exemplars() -> None:
    kit = kit_of(ROAD, [ring(1, 1), ring(2, 3)])
    copied = {"share": 1.0, "pieces": 1, "exemplar_share": 1.0, "exemplar": kit.exemplars[1].name}
    samples = [
        Sample("toy-0", "train", "variations", kit.name, "", {"copied": copied}, exemplar.assembly)
        for exemplar in kit.exemplars
    ]

    def pictures(low_diversity: str) -> np.ndarray:
        return np.array(
            Image.open(io.BytesIO(kit_variants_sheet(kit, samples, low_diversity, np.random.default_rng(0))))
        )

    plain, low_diversity = pictures(""), pictures("low diversity: alike")
    # Two samples become two pairs, and the second sample is its exemplar; both exemplars are shown by part type, too.
    assert low_diversity.shape[1] == plain.shape[1]
    ink = (low_diversity != low_diversity[0, 0]).any(axis=2).sum()
    assert ink > (plain != plain[0, 0]).any(axis=2).sum()
