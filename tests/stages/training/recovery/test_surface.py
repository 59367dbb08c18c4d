"""Even points, distances between clouds, frames and subsamples."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from stages.shape.geometry.clouds import chamfer_squared
from stages.training.recovery.clouds import frame_of, subsample
from stages.training.recovery.surface import even_points

SQUARES = np.array([[0, 0, 0], [3, 0, 0], [3, 1, 0], [0, 1, 0]], dtype=np.float64)
FACES = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)


def brute_chamfer(a: np.ndarray, b: np.ndarray) -> float:
    squared = ((a[:, None] - b[None]) ** 2).sum(axis=-1)
    return float(squared.min(axis=0).mean() + squared.min(axis=1).mean())


@given(seed=st.integers(0, 2**31), n=st.integers(1, 40), m=st.integers(1, 40))
def test_chamfer_distance_is_that_of_all_pairs(seed: int, n: int, m: int) -> None:
    rng = np.random.default_rng(seed)
    a, b = rng.normal(size=(n, 3)), rng.normal(size=(m, 3))
    assert np.isclose(chamfer_squared(a, b), brute_chamfer(a, b))


def test_even_points_are_on_the_surface_and_proportional_to_area() -> None:
    points = even_points(SQUARES, FACES, 3000)
    assert (points[:, 2] == 0.0).all()
    assert (points >= SQUARES.min(axis=0)).all()
    assert (points <= SQUARES.max(axis=0)).all()
    counts, _, _ = np.histogram2d(points[:, 0], points[:, 1], bins=(6, 2), range=((0, 3), (0, 1)))
    # random points in a cell of 250 deviate by 16, these by less
    assert np.abs(counts - 250).max() < 20


def test_even_points_move_little_with_the_surface() -> None:
    moved = SQUARES * [1.001, 1.0, 1.0]
    assert np.abs(even_points(SQUARES, FACES, 500) - even_points(moved, FACES, 500)).max() < 0.004


def test_frame_normalizes_any_position_and_size() -> None:
    points = np.random.default_rng(0).normal(size=(50, 3))
    frame = frame_of(points)
    normalized = frame.normalized(points)
    assert np.isclose(np.ptp(normalized, axis=0).max(), 1.0)
    assert np.allclose(frame_of(points * 7 + 3).normalized(points * 7 + 3), normalized)
    assert np.allclose(frame.placed(normalized), points)


@given(seed=st.integers(0, 2**31), n=st.integers(1, 30))
def test_subsample_draws_points_equally_often(seed: int, n: int) -> None:
    points = np.arange(10, dtype=np.float64)[:, None] * np.ones(3)
    counts = np.bincount(subsample(points, n, np.random.default_rng(seed))[:, 0].astype(int), minlength=10)
    assert counts.sum() == n
    assert np.ptp(counts) <= 1
