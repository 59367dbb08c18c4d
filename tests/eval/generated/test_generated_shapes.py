"""What a row about dreams says, on chains whose figures are known by heart."""

from __future__ import annotations

import pytest

from eval.generated.generated_shapes import COLUMNS, Dream, dream_row
from stages.shape.kit import Kit
from tests.toy_kits.chains_and_rings import CHAIN, chain, kit_of

LENGTHS = (3, 5, 7)


@pytest.fixture(scope="module")
def chains() -> Kit:
    """A kit whose exemplars are chains of three, five and seven links."""
    return kit_of(CHAIN, [chain(length) for length in LENGTHS])


def short_kit() -> Kit:
    """The same parts with the shortest chain alone as exemplar."""
    return kit_of(CHAIN, [chain(LENGTHS[0])])


def dreams(kit: Kit) -> list[Dream]:
    return [
        Dream(each.assembly, rooted=True, stable=number > 0, margin=0.1 * number)
        for number, each in enumerate(kit.exemplars)
    ]


def test_dreams_are_measured_against_exemplars_and_what_was_learnt(chains: Kit) -> None:
    all_three = dreams(chains)
    row = dict(zip(COLUMNS, dream_row("chains", short_kit(), all_three, all_three[:1]), strict=True))
    assert (row["shapes"], row["graphs"], row["histograms"], row["parts"], row["cycle rank"]) == (3, 3, 3, 7, 0)
    # of five links and two caps beside three and two: two parts more, of twelve
    assert row["E exemplar"] == row["E learnt"] == pytest.approx(2 / 12)
    # a cap and three links stand so at an end of the exemplar; a cap and the other three at its other end
    assert (row["copied %"], row["pieces"]) == (pytest.approx(100 * 4 / 7), 2)
    assert (row["rooted %"], row["stable %"]) == (100, pytest.approx(200 / 3))
    assert row["margin"] == pytest.approx(0.1)


def test_what_was_learnt_is_not_its_own_neighbour(chains: Kit) -> None:
    all_three = dreams(chains)
    row = dict(zip(COLUMNS, dream_row("chains", chains, all_three, all_three), strict=True))
    assert row["E exemplar"] == 0
    assert row["E learnt"] == pytest.approx(2 / 16), "the median of 2 in 12, 2 in 16, 2 in 16"
    assert row["copied %"] == 100
    alone = dict(zip(COLUMNS, dream_row("chains", chains, (one := all_three[:1]), one), strict=True))
    assert alone["E learnt"] == ""
