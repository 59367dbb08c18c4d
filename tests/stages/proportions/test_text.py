"""Proportions as text, there and back, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from stages.proportions.text import (
    ProportionError,
    Proportions,
    ProportionShapes,
    exemplar_of,
    proportion_text,
    read_proportions,
    shape_of_proportion_text,
)
from tests.stages.proportions.stools import kit, lattice


def test_a_text_comes_back_and_makes_the_shape_that_it_says() -> None:
    exemplar = kit().exemplars[0]
    warp = lattice().draw(np.random.default_rng(1), 0.2, 2.0)
    text = proportion_text(Proportions(exemplar.name, warp))
    read = read_proportions(text)
    assert exemplar_of(kit(), read.exemplar) is exemplar
    for one, other in zip(read.warp, warp, strict=True):
        np.testing.assert_array_equal(one, other)
    assert proportion_text(read) == text
    assert len(shape_of_proportion_text(ProportionShapes(kit()), text)) == len(exemplar.whole)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "not valid proportions"),
        ("[1, 2]", "proportions"),
        ('{"exemplar": "a", "x": [1], "y": [1]}', "keys exemplar, x, y and z"),
        ('{"exemplar": 1, "x": [1], "y": [1], "z": [1]}', "keys exemplar, x, y and z"),
        ('{"exemplar": "a", "x": ["b"], "y": [1], "z": [1]}', "not valid proportions"),
        ('{"exemplar": "a", "x": {"b": 1}, "y": [1], "z": [1]}', "not valid proportions"),
        ('{"exemplar": "another", "x": [1], "y": [1], "z": [1]}', "has no exemplar 'another'"),
        ('{"exemplar": "exemplar-0", "x": [1], "y": [1], "z": [1]}', "exemplar"),
    ],
)
def test_what_says_no_proportions_is_refused(text: str, why: str) -> None:
    with pytest.raises(ProportionError, match=why):
        shape_of_proportion_text(ProportionShapes(kit()), text)
