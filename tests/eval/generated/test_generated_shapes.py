"""The row of generated shapes, on chains with known values."""

from __future__ import annotations

import pytest

from eval.generated.generated_shapes import COLUMNS, GeneratedShape, generated_row
from stages.shape.kit import Kit
from tests.toy_kits.chains_and_rings import CHAIN, chain, kit_of

LENGTHS = (3, 5, 7)


@pytest.fixture(scope="module")
def chains() -> Kit:
    """Return a kit whose exemplars are chains of three, five and seven links."""
    return kit_of(CHAIN, [chain(length) for length in LENGTHS])


def short_kit() -> Kit:
    """Return a kit of the same parts with the shortest chain as its only exemplar."""
    return kit_of(CHAIN, [chain(LENGTHS[0])])


def shapes_of(kit: Kit) -> list[GeneratedShape]:
    return [
        GeneratedShape(exemplar.assembly, rooted=True, stable=number > 0, margin=0.1 * number)
        for number, exemplar in enumerate(kit.exemplars)
    ]


def test_generated_shapes_are_compared_with_exemplars_and_training(chains: Kit) -> None:
    all_three = shapes_of(chains)
    row = dict(zip(COLUMNS, generated_row("chains", short_kit(), all_three, all_three[:1]), strict=True))
    assert (row["shapes"], row["graphs"], row["histograms"], row["parts"], row["cycle rank"]) == (3, 3, 3, 7, 0)
    # five links and two caps against three and two: two more parts, of twelve
    assert row["E exemplar"] == row["E training"] == pytest.approx(2 / 12)
    # a cap and three links are verbatim at one end of the exemplar; a cap and the other three at the other
    assert (row["copied %"], row["pieces"]) == (pytest.approx(100 * 4 / 7), 2)
    assert (row["rooted %"], row["stable %"]) == (100, pytest.approx(200 / 3))
    assert row["margin"] == pytest.approx(0.1)


def test_training_shape_is_not_its_own_neighbour(chains: Kit) -> None:
    all_three = shapes_of(chains)
    row = dict(zip(COLUMNS, generated_row("chains", chains, all_three, all_three), strict=True))
    assert row["E exemplar"] == 0
    assert row["E training"] == pytest.approx(2 / 16), "the median of 2 in 12, 2 in 16, 2 in 16"
    assert row["copied %"] == 100
    alone = dict(zip(COLUMNS, generated_row("chains", chains, (first := all_three[:1]), first), strict=True))
    assert alone["E training"] == ""
