"""Corners of feature lines with coordinate frames: what candidates for symmetries are aligned by (symmetry §4.1)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stages.shape.arrays import FloatArray, IntArray
from stages.shape.geometry.triangles import unit_normals
from stages.symmetry.surface.welding import sides_by_edge, weld

CREASE = 0.4
"""Radians between the normals at an edge from which on it is a feature line."""
STRAIGHT = 0.2
"""Sine of the angle of two feature lines from which on they make a corner."""
MOST_LINES = 8
"""Corners of more feature lines are no corners but tips of cones."""


@dataclass(frozen=True)
class CornerFrames:
    """Right-handed frames in corners of feature lines, float64 (m, 4, 4): the first axis runs along a line, the second
    lies in the plane of it and another.

    kinds: float64 (m, 4): of a frame the angle of its lines, the turn of the surface at each, and the bend of the
    corner; frames that a symmetry can align agree in them. lengths: float64 (m, 2), of the two edges.
    """

    frames: FloatArray
    kinds: FloatArray
    lengths: FloatArray


def corner_frames(corners: FloatArray, tolerance: float) -> CornerFrames:
    """The frames of triangles `corners` (f, 3, 3); points closer than about `tolerance` are one.

    Of each corner those frames are taken whose kind is the first in order, all of them where several are equal.
    """
    places, vertices = weld(corners, tolerance)
    normals = unit_normals(corners)
    edges, turns, outwards = creases(places, normals)
    ends = np.concatenate([edges, edges[:, ::-1]])
    turns, outwards = np.concatenate([turns, turns]), np.concatenate([outwards, outwards])
    ways = vertices[ends[:, 1]] - vertices[ends[:, 0]]
    lengths = np.linalg.norm(ways, axis=1)
    real = lengths > tolerance
    ends, turns, outwards, ways, lengths = ends[real], turns[real], outwards[real], ways[real], lengths[real]
    ways = ways / lengths[:, None]
    order = np.lexsort((ends[:, 1], ends[:, 0]))
    return frames_of_lines(
        ends[order, 0], vertices[ends[order, 0]], ways[order], lengths[order], turns[order], outwards[order], 2
    )


def frames_of_lines(
    corner: np.ndarray,
    at: FloatArray,
    ways: FloatArray,
    lengths: FloatArray,
    turns: FloatArray,
    outwards: FloatArray,
    decimals: int,
) -> CornerFrames:
    """The frames of feature lines that begin in corners. Of each line: the number of its corner, int (m,), ascending;
    where that is, and the way that the line goes, float64 (m, 3) each; its length and the turn of the surface there,
    float64 (m,) each; and the sum of the normals beside it, float64 (m, 3). Kinds are compared to so many decimals."""
    first, second = _pairs(corner)
    across = ways[second] - (ways[first] * ways[second]).sum(axis=1)[:, None] * ways[first]
    sine = np.linalg.norm(across, axis=1)
    bent = sine > STRAIGHT
    first, second, across = first[bent], second[bent], across[bent] / sine[bent, None]
    frames = np.zeros((len(first), 4, 4))
    frames[:, :3, 0], frames[:, :3, 1], frames[:, :3, 2] = ways[first], across, np.cross(ways[first], across)
    frames[:, :3, 3], frames[:, 3, 3] = at[first], 1.0
    outward = outwards[first] + outwards[second]
    kinds = np.column_stack(
        [
            (ways[first] * ways[second]).sum(axis=1),
            turns[first],
            turns[second],
            (outward * frames[:, :3, 2]).sum(axis=1),
        ]
    )
    kinds = np.round(kinds, decimals) + 0.0
    chosen = _first_of_corner(corner[first], kinds)
    return CornerFrames(frames[chosen], kinds[chosen], np.column_stack([lengths[first], lengths[second]])[chosen])


def creases(places: IntArray, normals: FloatArray) -> tuple[np.ndarray, FloatArray, FloatArray]:
    """Edges at which the surface turns or ends, int64 (e, 2), how far it turns, in radians, -1 where it ends or more
    than two triangles meet, and the sum of the normals there, float64 (e, 3)."""
    sides = sides_by_edge(places)
    first, count = sides.first, sides.count
    one, two = sides.side[first] // 3, sides.side[first + count - 1] // 3
    turn = np.arccos(np.clip((normals[one] * normals[two]).sum(axis=1), -1.0, 1.0))
    turn[count != 2] = -1.0
    crease = (turn > CREASE) | (count != 2)
    edges = np.column_stack([sides.low[first], sides.high[first]])
    return edges[crease], turn[crease], (normals[one] + normals[two])[crease]


def _pairs(corner: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """All ordered pairs of different places with one value in the sorted int64 (n,) `corner`, of values that occur at
    most MOST_LINES times."""
    first = np.flatnonzero(np.r_[True, corner[1:] != corner[:-1]][: len(corner)])
    count = np.diff(np.r_[first, len(corner)])
    count[count > MOST_LINES] = 0
    start = np.repeat(first, count**2)
    width = np.repeat(count, count**2)
    number = np.arange(len(start)) - np.repeat(np.cumsum(count**2) - count**2, count**2)
    one, two = start + number // width, start + number % width
    return one[one != two], two[one != two]


def _first_of_corner(corner: np.ndarray, kinds: FloatArray) -> np.ndarray:
    """The places of the frames of each corner with its first kind, ascending by corner."""
    order = np.lexsort((*kinds.T[::-1], corner))
    ordered = corner[order]
    starts = np.flatnonzero(np.r_[True, ordered[1:] != ordered[:-1]][: len(ordered)])
    leader = np.repeat(order[starts], np.diff(np.r_[starts, len(order)]))
    chosen: np.ndarray = order[(kinds[order] == kinds[leader]).all(axis=1)]
    return chosen
