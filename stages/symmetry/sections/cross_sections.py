"""Sections of a surface by planes, and how alike two of them are: where a plane is a docking site (symmetry §3.2)."""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.geometry.grid_hash import OWN_CELL, cell_hash

TURNED = 0.3
"""Normals that are farther apart than this are of different sides."""
ROUNDING = 1e-9
"""By so much, as a share, a sum of lengths may be off."""


@dataclass(frozen=True)
class CrossSection:
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


def cross_section(corners: FloatArray, normals: FloatArray, heights: FloatArray, step: float) -> CrossSection:
    """The section of triangles (f, 3, 3) with unit `normals` (f, 3) by a plane that each of them crosses, over which
    their corners lie at `heights` (f, 3), with a point for each `step` of a line."""
    above = heights > 0
    alone = np.where(above.sum(axis=1) == 2, above.argmin(axis=1), above.argmax(axis=1))
    turn = (alone[:, None] + np.arange(3)) % 3
    tips = np.take_along_axis(corners, turn[..., None], axis=1)
    heights = np.take_along_axis(heights, turn, axis=1)
    share = (heights[:, :1] / (heights[:, :1] - heights[:, 1:]))[..., None]
    ends = tips[:, :1] + share * (tips[:, 1:] - tips[:, :1])
    line = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    count = np.maximum(1, np.ceil(line / step)).astype(np.int64)
    of = np.repeat(np.arange(len(line)), count)
    place = (np.arange(len(of)) - np.repeat(np.cumsum(count) - count, count) + 0.5) / count[of]
    points = ends[of, 0] + place[:, None] * (ends[of, 1] - ends[of, 0])
    return CrossSection(points, normals[of], (line / count)[of])


def shared_share(one: CrossSection, other: CrossSection, shift: FloatArray, tolerance: float, least: float) -> float:
    """The share of two sections that they have in common once `one` is moved by `shift` (3,): of the one that has less
    in common; 0 if that is less than `least`. Points count that have one of the other within `tolerance`, on a side
    that looks the same way."""
    if not len(one.points) or not len(other.points):
        return 0.0
    weight = tolerance / TURNED
    moved = np.column_stack([one.points + shift, weight * one.normals])
    others = np.column_stack([other.points, weight * other.normals])
    shares = []
    for points, lengths, onto in ((moved, one.lengths, others), (others, other.lengths, moved)):
        most = (1 - least) * (1 + ROUNDING) * float(lengths.sum())
        covered, enough = _covered(points, lengths, onto, tolerance, most)
        if not enough:
            return 0.0
        shares.append(float(lengths[covered].sum() / lengths.sum()))
    return min(shares)


@numba.njit(cache=True)
def _covered(points, lengths, others, tolerance, most):
    """Which of `points` (n, 6) have one of `others` (k, 6) within `tolerance`, bool (n,), and whether the `lengths` of
    those that have none come to `most` at most; as soon as they do not, it looks no further."""
    size = 1
    while size < 2 * len(others):
        size *= 2
    heads, following = np.full(size, -1), np.full(len(others), -1)
    for place in range(len(others)):
        cell = cell_hash(others[place], OWN_CELL, tolerance) & (size - 1)
        following[place] = heads[cell]
        heads[cell] = place
    covered = np.zeros(len(points), dtype=np.bool_)
    bare = 0.0
    for number in range(len(points)):
        for turn in range(27):
            cell = cell_hash(points[number], (turn + OWN_CELL) % 27, tolerance) & (size - 1)  # its own first
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
            bare += lengths[number]
            if bare > most:
                return covered, False
    return covered, True
