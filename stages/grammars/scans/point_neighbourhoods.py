"""The neighbourhood of each point of a cloud: local plane, noise, and whether the point is an outlier."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from stages.shape.arrays import BoolArray, FloatArray, IntArray

MIN_NEIGHBOURS, MAX_NEIGHBOURS = 12, 32
"""Points in a neighbourhood, including the point itself."""
REACH_PER_NOISE = 5.0
"""Neighbourhoods reach this many standard deviations of the noise, as far as their numbers of points allow."""
OUTLIER_REACH = 4.0
"""A point is an outlier if its neighbours reach this many times as far as usual."""
ESTIMATE_POINTS = 2000
"""Points at which the noise is estimated before all points are looked at."""
BLOCK_POINTS = 100_000
"""Points whose neighbourhoods are computed together, which bounds memory."""


@dataclass(frozen=True)
class PointNeighbourhoods:
    """Neighbourhoods of n points.

    near: int32 (n, k), the k nearest points, the point itself first
    reach: float64 (n,), distance of the farthest of them
    normals: float64 (n, 3), of the planes through them, of either sign
    roughness: float64 (n,), standard deviation of their distances from the plane
    outlier: bool (n,)
    """

    near: IntArray
    reach: FloatArray
    normals: FloatArray
    roughness: FloatArray
    outlier: BoolArray

    @property
    def noise(self) -> float:
        """Standard deviation of the noise, in the units of the points: the median roughness."""
        return float(np.median(self.roughness[~self.outlier]))


def point_neighbourhoods(points: FloatArray) -> PointNeighbourhoods:
    """Compute the neighbourhoods of at least MAX_NEIGHBOURS points (n, 3); more noise takes more neighbours."""
    from scipy.spatial import KDTree

    tree = KDTree(points, balanced_tree=False, compact_nodes=False)
    noise, reach, count = _estimate(tree, points)
    wanted = count * (REACH_PER_NOISE * noise / max(reach, 1e-300)) ** 2
    return _around(tree, points, points, int(np.clip(wanted, MIN_NEIGHBOURS, MAX_NEIGHBOURS)))


def estimate_noise(points: FloatArray) -> tuple[float, float, int]:
    """Return the noise of points (n, 3), the reach of a neighbourhood, and the number of points in it.

    Noise and reach are medians over a subsample.
    """
    from scipy.spatial import KDTree

    return _estimate(KDTree(points, balanced_tree=False, compact_nodes=False), points)


def _estimate(tree: Any, points: FloatArray) -> tuple[float, float, int]:
    sample = points[:: max(1, len(points) // ESTIMATE_POINTS)]
    around = _around(tree, points, sample, MIN_NEIGHBOURS)
    return around.noise, float(np.median(around.reach)), MIN_NEIGHBOURS


def _around(tree: Any, points: FloatArray, centres: FloatArray, count: int) -> PointNeighbourhoods:
    """Return the neighbourhoods, `count` of points (n, 3) each, of `centres` (m, 3)."""
    near = np.empty((len(centres), count), dtype=np.int32)
    reach, roughness, normals = np.empty(len(centres)), np.empty(len(centres)), np.empty((len(centres), 3))
    for begin in range(0, len(centres), BLOCK_POINTS):
        block = slice(begin, begin + BLOCK_POINTS)
        distances, near[block] = tree.query(centres[block], k=count)
        reach[block] = distances[:, -1]
        around = points[near[block]]
        around -= around.mean(axis=1, keepdims=True)
        values, axes = np.linalg.eigh(around.transpose(0, 2, 1) @ around)
        # a plane takes three degrees of freedom
        roughness[block], normals[block] = np.sqrt(np.maximum(values[:, 0], 0) / (count - 3)), axes[:, :, 0]
    return PointNeighbourhoods(near, reach, normals, roughness, reach > OUTLIER_REACH * np.median(reach))


def patch_contacts(near: IntArray, patch_of: IntArray) -> tuple[IntArray, IntArray]:
    """Return pairs of neighbouring points of different patches, int32 (c,) each."""
    nearest = near[:, 1:MIN_NEIGHBOURS]
    one, other = np.repeat(np.arange(len(near), dtype=np.int32), nearest.shape[1]), nearest.reshape(-1)
    chosen = (patch_of[one] >= 0) & (patch_of[other] >= 0) & (patch_of[one] != patch_of[other])
    return one[chosen], other[chosen]
