"""The contact sheet of a kit's variants."""

from __future__ import annotations

import io

import numpy as np
from PIL import Image

from stages.shape.sample import Sample
from stages.variations.sheet import kit_variants_sheet
from tests.stages.variations.exchange.test_search import search
from tests.stages.variations.toy import ROAD, kit_of, ring


def test_a_sheet_has_rows_for_the_exemplars_the_first_chosen_and_some_of_the_rest() -> None:
    kit = kit_of(ROAD, [ring(1, 1), ring(2, 3)])
    _, found = search(kit, tries=300, largest=3.0)
    samples = [
        Sample(f"toy-{place:06d}", "train", "variations", kit.name, "", {}, found[place % len(found)].assembly)
        for place in range(30)
    ]
    whole = Image.open(io.BytesIO(kit_variants_sheet(kit, samples, np.random.default_rng(0))))
    first = Image.open(io.BytesIO(kit_variants_sheet(kit, samples[:24], np.random.default_rng(0))))
    few = Image.open(io.BytesIO(kit_variants_sheet(kit, samples[:3], np.random.default_rng(0))))
    assert whole.height > first.height > few.height
    assert whole.width == first.width > few.width
