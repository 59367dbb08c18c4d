"""What is around each point of a cloud: how the surface lies there, how noisy it is, and what is an outlier."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from stages.shape.arrays import BoolArray, FloatArray, IntArray

LEAST_NEIGHBOURS, MOST_NEIGHBOURS = 12, 32
"""Points around a point that say how the surface lies there, itself among them."""
SMOOTH = 5.0
"""Neighbourhoods reach so many standard deviations of the noise, as far as their numbers of points allow."""
ALONE = 4.0
"""A point is an outlier if its neighbours reach so many times as far as is usual."""
GLANCE = 2000
"""At so many points the noise is estimated before all of them are looked at."""
BLOCK = 100_000
"""So many neighbourhoods are looked at at once."""


@dataclass(frozen=True)
class PointNeighbourhoods:
    """What is around each of n points: `near`, the k nearest, itself first, int32 (n, k); `reach`, how far they
    are, float64 (n,); `normals` of the planes through them, float64 (n, 3), of either sign; `rough`, how far from it
    they are, a standard deviation, float64 (n,); `lonely`, bool (n,), outliers. noise: of the whole cloud, the median
    of `rough`."""

    near: IntArray
    reach: FloatArray
    normals: FloatArray
    rough: FloatArray
    lonely: BoolArray

    @property
    def noise(self) -> float:
        """A standard deviation, in the units of the points."""
        return float(np.median(self.rough[~self.lonely]))


def point_neighbourhoods(points: FloatArray) -> PointNeighbourhoods:
    """The neighbourhoods of at least MOST_NEIGHBOURS points (n, 3), of as many points as their noise asks for."""
    from scipy.spatial import KDTree

    tree = KDTree(points, balanced_tree=False, compact_nodes=False)
    noise, reach, count = _glance(tree, points)
    wanted = count * (SMOOTH * noise / max(reach, 1e-300)) ** 2
    return _around(tree, points, points, int(np.clip(wanted, LEAST_NEIGHBOURS, MOST_NEIGHBOURS)))


def estimate_noise(points: FloatArray) -> tuple[float, float, int]:
    """The noise of points (n, 3), and how far neighbourhoods of so many points reach, medians of some of them."""
    from scipy.spatial import KDTree

    return _glance(KDTree(points, balanced_tree=False, compact_nodes=False), points)


def _glance(tree: Any, points: FloatArray) -> tuple[float, float, int]:
    found = _around(tree, points, points[:: max(1, len(points) // GLANCE)], LEAST_NEIGHBOURS)
    return found.noise, float(np.median(found.reach)), LEAST_NEIGHBOURS


def _around(tree: Any, points: FloatArray, asked: FloatArray, count: int) -> PointNeighbourhoods:
    """The neighbourhoods, of `count` out of points (n, 3), around those `asked`, (m, 3)."""
    near = np.empty((len(asked), count), dtype=np.int32)
    reach, rough, normals = np.empty(len(asked)), np.empty(len(asked)), np.empty((len(asked), 3))
    for begin in range(0, len(asked), BLOCK):
        block = slice(begin, begin + BLOCK)
        away, near[block] = tree.query(asked[block], k=count)
        reach[block] = away[:, -1]
        around = points[near[block]]
        around -= around.mean(axis=1, keepdims=True)
        values, ways = np.linalg.eigh(around.transpose(0, 2, 1) @ around)
        # a plane takes three degrees of freedom
        rough[block], normals[block] = np.sqrt(np.maximum(values[:, 0], 0) / (count - 3)), ways[:, :, 0]
    return PointNeighbourhoods(near, reach, normals, rough, reach > ALONE * np.median(reach))


def patch_contacts(near: IntArray, of: IntArray) -> tuple[IntArray, IntArray]:
    """Pairs of neighbouring points of different patches, int32 (c,) each."""
    nearest = near[:, 1:LEAST_NEIGHBOURS]
    one, other = np.repeat(np.arange(len(near), dtype=np.int32), nearest.shape[1]), nearest.reshape(-1)
    chosen = (of[one] >= 0) & (of[other] >= 0) & (of[one] != of[other])
    return one[chosen], other[chosen]
