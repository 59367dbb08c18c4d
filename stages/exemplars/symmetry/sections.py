"""Sections of a surface by planes, and how alike two of them are: where a plane is a docking site (symmetry §3.2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stages.shape.arrays import FloatArray

__all__ = ["Section", "alike", "section"]

TURNED = 0.3
"""Normals that are farther apart than this are of different sides."""


@dataclass(frozen=True)
class Section:
    """The lines in which a plane cuts a surface, as points along them.

    points: float64 (n, 3); normals: float64 (n, 3), of the surface there; lengths: float64 (n,), the line that each
    point stands for.
    """

    points: FloatArray
    normals: FloatArray
    lengths: FloatArray

    @property
    def length(self) -> float:
        """Length of all lines."""
        return float(self.lengths.sum())


def section(corners: FloatArray, normals: FloatArray, way: FloatArray, offset: float, step: float) -> Section:
    """The section of triangles (f, 3, 3) with unit `normals` (f, 3) by the plane of points x with `way` (3,) times x =
    `offset`, with a point for each `step` of a line."""
    height = corners @ way - offset
    above = height > 0
    crossing = above.any(axis=1) & ~above.all(axis=1)
    corners, height, above = corners[crossing], height[crossing], above[crossing]
    alone = np.where(above.sum(axis=1) == 2, above.argmin(axis=1), above.argmax(axis=1))
    turn = (alone[:, None] + np.arange(3)) % 3
    tips = np.take_along_axis(corners, turn[..., None], axis=1)
    height = np.take_along_axis(height, turn, axis=1)
    share = (height[:, :1] / (height[:, :1] - height[:, 1:]))[..., None]
    ends = tips[:, :1] + share * (tips[:, 1:] - tips[:, :1])
    line = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    count = np.maximum(1, np.ceil(line / step)).astype(np.int64)
    of = np.repeat(np.arange(len(line)), count)
    place = (np.arange(len(of)) - np.repeat(np.cumsum(count) - count, count) + 0.5) / count[of]
    points = ends[of, 0] + place[:, None] * (ends[of, 1] - ends[of, 0])
    return Section(points, normals[crossing][of], (line / count)[of])


def alike(one: Section, other: Section, shift: FloatArray, tolerance: float) -> float:
    """The share of two sections that they have in common once `one` is moved by `shift` (3,): of the one that has less
    in common. Points count that have one of the other within `tolerance`, on a side that looks the same way."""
    if not len(one.points) or not len(other.points):
        return 0.0
    moved = one.points + shift
    return min(
        _covered(moved, one.normals, one.lengths, other.points, other.normals, tolerance),
        _covered(other.points, other.normals, other.lengths, moved, one.normals, tolerance),
    )


def _covered(
    points: FloatArray,
    normals: FloatArray,
    lengths: FloatArray,
    others: FloatArray,
    other_normals: FloatArray,
    tolerance: float,
) -> float:
    from scipy.spatial import KDTree

    weight = tolerance / TURNED
    near, _ = KDTree(np.column_stack([others, weight * other_normals])).query(
        np.column_stack([points, weight * normals]), distance_upper_bound=tolerance
    )
    return float(lengths[near < tolerance].sum() / lengths.sum())
