"""Warps that were drawn: the farthest come first, and none that is nearly another."""

from __future__ import annotations

import numpy as np

from stages.proportions.distinct_warps import DistinctWarps
from stages.proportions.warp import Warp
from tests.stages.proportions.stools import lattice


def wide(factor: float) -> Warp:
    """Return the warp that widens the stool by a factor."""
    x, y, z = (np.ones(len(lengths)) for lengths in lattice().lengths)
    return factor * x, y, z


def end(factor: float) -> float:
    """Half its width, as a share of its diagonal."""
    width, rest = 1.0 * factor, np.hypot(1.1, 0.6)
    return float(width / 2 / np.hypot(width, rest))


def test_what_is_nearly_the_exemplar_or_another_is_not_new() -> None:
    drawn = DistinctWarps(lattice(), 0.05)
    assert not drawn.is_new(wide(1.0))
    assert not drawn.is_new(wide(1.05))
    assert end(1.05) - end(1.0) < 0.05 < end(1.5) - end(1.0)
    assert drawn.is_new(wide(1.5))
    drawn.add(wide(1.5))
    assert not drawn.is_new(wide(1.52))
    assert drawn.is_new(wide(2.5))
    assert not DistinctWarps(lattice(), 0.05).is_new(
        tuple(2 * factors for factors in wide(1.0))
    )  # at equal size it is the same


def test_the_farthest_come_first_and_none_that_are_alike() -> None:
    drawn = DistinctWarps(lattice(), 0.02)
    assert drawn.farthest_first(5) == []
    for factor in (1.5, 3.0, 1.52, 0.4, 1.01):
        drawn.add(wide(factor))
    assert drawn.farthest_first(5) == [1, 3, 2]
    assert drawn.farthest_first(2) == [1, 3]


def test_more_are_kept_than_there_is_room_for_at_first() -> None:
    drawn = DistinctWarps(lattice(), 0.0)
    for place in range(100):
        assert drawn.is_new(wide(1.1 + 0.01 * place))
        drawn.add(wide(1.1 + 0.01 * place))
    assert len(drawn) == len(drawn.farthest_first(200)) == 100
