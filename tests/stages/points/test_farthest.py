"""Farthest points: exactly what brute force picks."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stages.points.cloud import farthest_points


def brute_force(points: np.ndarray, n: int, start: int) -> list[int]:
    squared = np.full(len(points), np.inf)
    picks = [start]
    while len(picks) < n:
        x, y, z = (points - points[picks[-1]]).T
        squared = np.minimum(squared, x * x + y * y + z * z)
        squared[picks] = -1.0
        picks.append(int(np.argmax(squared)))
    return picks


def test_a_line_of_points_is_split_from_its_ends() -> None:
    line = np.stack([np.arange(9.0), np.zeros(9), np.zeros(9)], axis=1)
    assert farthest_points(line, 5, start=0).tolist() == [0, 8, 4, 2, 6]


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    count=st.integers(1, 700),
    grid=st.sampled_from([None, 1, 3]),
    flat=st.booleans(),
    share=st.floats(0.0, 1.0),
)
def test_picks_equal_those_of_brute_force(seed: int, count: int, grid: int | None, flat: bool, share: float) -> None:
    """Random clouds, and clouds on a coarse grid: full of equal distances and of points that stand twice."""
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(count, 3)) if grid is None else rng.integers(0, grid + 1, (count, 3)).astype(float)
    points[:, 2] *= not flat
    n, start = 1 + int(share * (count - 1)), int(rng.integers(count))
    assert farthest_points(points, n, start).tolist() == brute_force(points, n, start)


def test_a_large_cloud_of_single_precision_equals_brute_force() -> None:
    points = np.random.default_rng(7).random((20_000, 3)).astype(np.float32)
    assert farthest_points(points, 300, start=11).tolist() == brute_force(points.astype(np.float64), 300, 11)


@pytest.mark.parametrize(("n", "start"), [(0, 0), (4, 0), (2, 3), (2, -1)])
def test_counts_and_starts_out_of_range_are_refused(n: int, start: int) -> None:
    with pytest.raises(ValueError, match="of 3 points"):
        farthest_points(np.zeros((3, 3)), n, start)
