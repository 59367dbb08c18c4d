"""Faces that fill a closed outline."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from stages.shape.arrays import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class Cap:
    """A filling of an outline of k points.

    quads: int32 (q, 4), counter-clockwise with the outline; a triangle repeats its last index
    middle: whether index k is used, for the mean of the points
    """

    quads: IntArray
    middle: bool


def polygon_cap(points: FloatArray) -> Cap:
    """Fill a simple counter-clockwise polygon, float64 (k, 2), from its middle where that sees all sides."""
    from stages.programs.curves.kernels import all_seen

    count = len(points)
    seen, convex = all_seen(points)
    if convex:
        return Cap(fan(count), count > 4)
    if seen:
        return Cap(_spokes(count), True)
    return Cap(_clipped(points.tobytes()), False)


@lru_cache(maxsize=256)
def fan(count: int) -> IntArray:
    """Quads (two sides each) between an outline and its middle, int32 (q, 4); one face for three or four points."""
    if count <= 4:
        return np.array([[0, 1, 2, 2 if count == 3 else 3]], dtype=np.int32)
    first = np.arange(0, count - 1, 2)
    quads = np.stack([np.full(len(first), count), first, first + 1, (first + 2) % count], axis=1)
    if count % 2:
        quads = np.concatenate([quads, [[count, count - 1, 0, 0]]])
    return quads.astype(np.int32)


@lru_cache(maxsize=64)
def _spokes(count: int) -> IntArray:
    """Triangles between an outline and its middle, since two at a notch make no valid quad."""
    index = np.arange(count, dtype=np.int32)
    after = np.roll(index, -1)
    return np.stack([index, after, np.full_like(index, count), np.full_like(index, count)], axis=1)


@lru_cache(maxsize=1024)
def _clipped(outline: bytes) -> IntArray:
    """Clip ears, the fattest first, int32 (k - 2, 4)."""
    points = np.frombuffer(outline, dtype=np.float64).reshape(-1, 2)
    left = list(range(len(points)))
    quads = []
    while len(left) > 3:
        best, ear = -1.0, -1
        for index in range(len(left)):
            quality = _ear_quality(points, left, index)
            if quality > best:
                best, ear = quality, index
        if best <= 0.0:
            raise ValueError("the outline crosses or touches itself and cannot be filled: move its points apart")
        i, j, k = left[ear - 1], left[ear], left[(ear + 1) % len(left)]
        quads.append([i, j, k, k])
        left.pop(ear)
    quads.append([*left, left[2]])
    return np.array(quads, dtype=np.int32)


def _ear_quality(points: FloatArray, left: list[int], index: int) -> float:
    """Area of the triangle at an index over the square of its longest side; -1 where it is no ear."""
    i, j, k = left[index - 1], left[index], left[(index + 1) % len(left)]
    corners = points[[i, j, k]]
    sides = np.roll(corners, -1, axis=0) - corners
    area = sides[0, 0] * sides[1, 1] - sides[0, 1] * sides[1, 0]
    if area <= 0.0:
        return -1.0
    others = points[[other for other in left if other not in (i, j, k)]]
    offsets = others[:, None] - corners
    within = (sides[:, 0] * offsets[..., 1] - sides[:, 1] * offsets[..., 0] >= 0.0).all(axis=1)
    return -1.0 if within.any() else float(area / (sides * sides).sum(axis=1).max())
