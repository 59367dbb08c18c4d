"""Augmentation of clouds: each way does what it says and no more."""

from __future__ import annotations

import numpy as np
import pytest

from stages.training.point_encoder.augmentation import MIN_PARTIAL_SHARE, augmented_cloud

WAYS = ("turn", "stretch", "jitter", "partial", "noise")


@pytest.fixture
def cloud() -> tuple[np.ndarray, np.ndarray]:
    """A centred cloud of diagonal 1 with three parts."""
    points = np.random.default_rng(0).random((600, 3))
    points[:2] = [[0, 0, 0], [1, 1, 1]]
    parts = np.repeat([4, 7, 9], 200).astype(np.int32)
    return ((points - 0.5) / np.sqrt(3)).astype(np.float32), parts


def test_without_a_way_the_cloud_stays(cloud: tuple[np.ndarray, np.ndarray]) -> None:
    points, parts = augmented_cloud(*cloud, (), np.random.default_rng(1))
    np.testing.assert_allclose(points, cloud[0], atol=1e-6)
    assert np.array_equal(parts, cloud[1])


@pytest.mark.parametrize("way", WAYS)
def test_augmented_cloud_has_diagonal_1_and_depends_on_the_stream_alone(
    way: str, cloud: tuple[np.ndarray, np.ndarray]
) -> None:
    first, second = (augmented_cloud(*cloud, (way,), np.random.default_rng(2)) for _ in range(2))
    assert np.array_equal(first[0], second[0])
    assert first[0].shape == (600, 3)
    assert np.linalg.norm(np.ptp(first[0], axis=0)) == pytest.approx(1, abs=1e-5)
    assert not np.allclose(first[0], cloud[0], atol=1e-4)


def test_turn_keeps_the_proportions_of_heights(cloud: tuple[np.ndarray, np.ndarray]) -> None:
    points, _ = augmented_cloud(*cloud, ("turn",), np.random.default_rng(3))
    assert np.corrcoef(points[:, 1], cloud[0][:, 1])[0, 1] == pytest.approx(1)


def test_jitter_moves_whole_parts(cloud: tuple[np.ndarray, np.ndarray]) -> None:
    points, parts = augmented_cloud(*cloud, ("jitter",), np.random.default_rng(4))
    for part in (4, 7, 9):
        for axis in range(3):
            before, after = cloud[0][parts == part, axis], points[parts == part, axis]
            slope, offset = np.polyfit(before, after, 1)
            np.testing.assert_allclose(after, slope * before + offset, atol=1e-5)


def test_partial_cloud_repeats_points_of_one_side(cloud: tuple[np.ndarray, np.ndarray]) -> None:
    shares = []
    for seed in range(20):
        points, parts = augmented_cloud(*cloud, ("partial",), np.random.default_rng(seed))
        shares.append(len(np.unique(points, axis=0)) / 600)
        assert len(parts) == 600
    assert MIN_PARTIAL_SHARE <= min(shares) < max(shares) <= 1
