"""Sections of a surface by planes, and how much of two sections is equal: where a plane is a docking site
(symmetry §3.2)."""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.geometry.hash_tables import OWN_CELL, cell_hash

MAX_NORMAL_DISTANCE = 0.3
"""Unit normals that are farther apart belong to different sides."""
ROUNDING_SHARE = 1e-9
"""Relative error of a sum of lengths."""


@dataclass(frozen=True)
class PlaneSection:
    """The lines in which a plane cuts a surface, as points along them.

    points: float64 (n, 3)
    normals: float64 (n, 3), of the surface at the points
    lengths: float64 (n,), of the piece of line around each point
    """

    points: FloatArray
    normals: FloatArray
    lengths: FloatArray

    @property
    def length(self) -> float:
        """Length of all lines."""
        return float(self.lengths.sum())


def plane_section(corners: FloatArray, normals: FloatArray, heights: FloatArray, step: float) -> PlaneSection:
    """Cut triangles by a plane that crosses each of them.

    corners: float64 (f, 3, 3)
    normals: float64 (f, 3), unit length
    heights: float64 (f, 3), of the corners above the plane
    step: largest distance between points along a line
    """
    above = heights > 0
    alone = np.where(above.sum(axis=1) == 2, above.argmin(axis=1), above.argmax(axis=1))
    turn = (alone[:, None] + np.arange(3)) % 3
    tips = np.take_along_axis(corners, turn[..., None], axis=1)
    heights = np.take_along_axis(heights, turn, axis=1)
    share = (heights[:, :1] / (heights[:, :1] - heights[:, 1:]))[..., None]
    ends = tips[:, :1] + share * (tips[:, 1:] - tips[:, :1])
    line = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    count = np.maximum(1, np.ceil(line / step)).astype(np.int64)
    owner = np.repeat(np.arange(len(line)), count)
    along = (np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count) + 0.5) / count[owner]
    points = ends[owner, 0] + along[:, None] * (ends[owner, 1] - ends[owner, 0])
    return PlaneSection(points, normals[owner], (line / count)[owner])


def shared_share(one: PlaneSection, other: PlaneSection, shift: FloatArray, tolerance: float, least: float) -> float:
    """Return the share of two sections that is equal once `one` is moved by `shift` (3,), the smaller of both shares.

    tolerance: distance between equal points; their normals must agree too
    least: smaller shares count as 0
    """
    if not len(one.points) or not len(other.points):
        return 0.0
    weight = tolerance / MAX_NORMAL_DISTANCE
    moved = np.column_stack([one.points + shift, weight * one.normals])
    others = np.column_stack([other.points, weight * other.normals])
    shares = []
    for points, lengths, onto in ((moved, one.lengths, others), (others, other.lengths, moved)):
        allowed = (1 - least) * (1 + ROUNDING_SHARE) * float(lengths.sum())
        covered, enough = _covered(points, lengths, onto, tolerance, allowed)
        if not enough:
            return 0.0
        shares.append(float(lengths[covered].sum() / lengths.sum()))
    return min(shares)


@numba.njit(cache=True)
def _covered(points, lengths, others, tolerance, allowed):
    """Return which of `points` (n, 6) have one of `others` (k, 6) within `tolerance`, bool (n,).

    Also returns whether the `lengths` of uncovered points add up to at most `allowed`. The search stops as soon as
    they do not.
    """
    size = 1
    while size < 2 * len(others):
        size *= 2
    heads, following = np.full(size, -1), np.full(len(others), -1)
    for place in range(len(others)):
        cell = cell_hash(others[place], OWN_CELL, tolerance) & (size - 1)
        following[place] = heads[cell]
        heads[cell] = place
    covered = np.zeros(len(points), dtype=np.bool_)
    uncovered = 0.0
    for number in range(len(points)):
        for turn in range(27):
            cell = cell_hash(points[number], (turn + OWN_CELL) % 27, tolerance) & (size - 1)  # its own cell first
            place = heads[cell]
            while place >= 0 and not covered[number]:
                total = 0.0
                for k in range(6):
                    total += (others[place, k] - points[number, k]) ** 2
                covered[number] = total < tolerance**2
                place = following[place]
            if covered[number]:
                break
        if not covered[number]:
            uncovered += lengths[number]
            if uncovered > allowed:
                return covered, False
    return covered, True
