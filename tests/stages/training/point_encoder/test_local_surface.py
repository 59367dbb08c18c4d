"""Normals and spreads around points, against numpy's eigenvectors, and where points lie on a plane, a line, a spot."""

from __future__ import annotations

import numpy as np
import torch

from stages.shape.arrays import FloatArray
from stages.training.point_encoder.local_surface import FEATURES_PER_COUNT, NEIGHBOR_COUNTS, local_surface
from stages.training.recovery.neighbors import nearest_neighbors


def features_of(cloud: FloatArray, neighbors: int = max(NEIGHBOR_COUNTS)) -> FloatArray:
    """Features of one cloud, float32 (n, counts, 9)."""
    points = torch.from_numpy(cloud.astype(np.float32))[None]
    found = local_surface(points, nearest_neighbors(points, neighbors))[0].numpy()
    return found.reshape(len(cloud), -1, FEATURES_PER_COUNT)


def test_axes_are_those_of_numpy() -> None:
    cloud = np.random.default_rng(0).normal(size=(60, 3)) * (3.0, 1.0, 0.4)
    found = features_of(cloud)
    for i, of_counts in enumerate(found):
        order = np.argsort(np.linalg.norm(cloud - cloud[i], axis=1))
        for count, described in zip(NEIGHBOR_COUNTS, of_counts, strict=True):
            values, vectors = np.linalg.eigh(np.cov(cloud[order[:count]].T, bias=True))
            x, y, z = vectors[:, 0]
            outer = (x * x, y * y, z * z, x * y, x * z, y * z)
            np.testing.assert_allclose(described, [*outer, *np.sqrt(values / values.sum())], atol=2e-4)


def test_plane_has_its_normal_and_no_thickness() -> None:
    rng, normal = np.random.default_rng(1), np.array([2.0, -1.0, 2.0]) / 3.0
    across, along = np.array([1.0, 2.0, 0.0]) / np.sqrt(5.0), np.cross(normal, np.array([1.0, 2.0, 0.0]) / np.sqrt(5.0))
    cloud = rng.random((100, 1)) * across + rng.random((100, 1)) * along + 5.0 * normal
    expected = [4 / 9, 1 / 9, 4 / 9, -2 / 9, 4 / 9, -2 / 9, 0.0]
    np.testing.assert_allclose(features_of(cloud)[..., :7], np.broadcast_to(expected, (100, 3, 7)), atol=1e-2)


def test_line_and_coincident_points() -> None:
    line = np.arange(40)[:, None] * np.array([0.0, 0.0, 1.0])
    np.testing.assert_allclose(features_of(line)[..., 6:], np.broadcast_to([0.0, 0.0, 1.0], (40, 3, 3)), atol=1e-6)
    assert not features_of(np.ones((40, 3))).any()


def test_small_clouds_take_all_their_points() -> None:
    cloud = np.random.default_rng(2).random((5, 3))
    found = features_of(cloud, neighbors=5)
    np.testing.assert_array_equal(found[:, 0], found[:, 1])
    np.testing.assert_allclose(found[0], np.broadcast_to(found[4, 0], (3, 9)), atol=1e-5)
