"""Corners of feature lines with coordinate frames, by which symmetry candidates are aligned (symmetry §4.1)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stages.shape.arrays import FloatArray, IntArray
from stages.shape.geometry.triangles import unit_normals
from stages.symmetry.surface.welding import sides_by_edge, weld

MIN_CREASE_RADIANS = 0.4
"""Smallest angle between the normals at an edge that makes it a feature line."""
MIN_CORNER_SINE = 0.2
"""Two feature lines make a corner if the sine of their angle is larger."""
MAX_LINES_PER_CORNER = 8
"""Where more feature lines meet there is no corner but the tip of a cone."""
KIND_DECIMALS = 2
"""Decimals to which kinds of frames on meshes are compared."""


@dataclass(frozen=True)
class CornerFrames:
    """Right-handed frames in corners of feature lines.

    The first axis runs along a line, the second lies in the plane of it and another line.

    frames: float64 (m, 4, 4)
    kinds: float64 (m, 4), cosine of the angle of the two lines, turn of the surface at each, and bend of the corner;
        frames that a symmetry can align agree in them
    lengths: float64 (m, 2), of the two lines
    """

    frames: FloatArray
    kinds: FloatArray
    lengths: FloatArray


def corner_frames(corners: FloatArray, tolerance: float) -> CornerFrames:
    """Find the corner frames of triangles (f, 3, 3); points closer than about `tolerance` are the same.

    Each corner has the frames of the kind that sorts first, all of them if several are equal.
    """
    indices, vertices = weld(corners, tolerance)
    normals = unit_normals(corners)
    edges, turns, outwards = creases(indices, normals)
    ends = np.concatenate([edges, edges[:, ::-1]])
    turns, outwards = np.concatenate([turns, turns]), np.concatenate([outwards, outwards])
    ways = vertices[ends[:, 1]] - vertices[ends[:, 0]]
    lengths = np.linalg.norm(ways, axis=1)
    real = lengths > tolerance
    ends, turns, outwards, ways, lengths = ends[real], turns[real], outwards[real], ways[real], lengths[real]
    lines = FeatureLines(ends[:, 0], vertices[ends[:, 0]], ways / lengths[:, None], lengths, turns, outwards)
    return frames_of_lines(lines.select(np.lexsort((ends[:, 1], ends[:, 0]))), KIND_DECIMALS)


@dataclass(frozen=True)
class FeatureLines:
    """Feature lines that begin in corners.

    corner: int64 (m,), number of the corner
    at: float64 (m, 3), position of the corner
    ways: float64 (m, 3), unit directions
    lengths: float64 (m,)
    turns: float64 (m,), turn of the surface at the line, in radians
    outwards: float64 (m, 3), sum of the two normals at the line
    """

    corner: np.ndarray
    at: FloatArray
    ways: FloatArray
    lengths: FloatArray
    turns: FloatArray
    outwards: FloatArray

    def select(self, order: np.ndarray) -> FeatureLines:
        """Return the lines with indices int64 (k,)."""
        return FeatureLines(
            self.corner[order],
            self.at[order],
            self.ways[order],
            self.lengths[order],
            self.turns[order],
            self.outwards[order],
        )


def frames_of_lines(lines: FeatureLines, decimals: int) -> CornerFrames:
    """Make the frames of feature lines, which are in the order of their corners; compare kinds to so few decimals."""
    ways, turns = lines.ways, lines.turns
    first, second = _pairs(lines.corner)
    across = ways[second] - (ways[first] * ways[second]).sum(axis=1)[:, None] * ways[first]
    sine = np.linalg.norm(across, axis=1)
    bent = sine > MIN_CORNER_SINE
    first, second, across = first[bent], second[bent], across[bent] / sine[bent, None]
    frames = np.zeros((len(first), 4, 4))
    frames[:, :3, 0], frames[:, :3, 1], frames[:, :3, 2] = ways[first], across, np.cross(ways[first], across)
    frames[:, :3, 3], frames[:, 3, 3] = lines.at[first], 1.0
    outward = lines.outwards[first] + lines.outwards[second]
    kinds = np.column_stack(
        [
            (ways[first] * ways[second]).sum(axis=1),
            turns[first],
            turns[second],
            (outward * frames[:, :3, 2]).sum(axis=1),
        ]
    )
    kinds = np.round(kinds, decimals) + 0.0
    chosen = _first_of_corner(lines.corner[first], kinds)
    lengths = np.column_stack([lines.lengths[first], lines.lengths[second]])
    return CornerFrames(frames[chosen], kinds[chosen], lengths[chosen])


def creases(indices: IntArray, normals: FloatArray) -> tuple[np.ndarray, FloatArray, FloatArray]:
    """Find the edges of welded triangles (f, 3) at which the surface turns or ends.

    Returns the edges, int64 (e, 2); their turns in radians, float64 (e,), -1 where the surface ends or more than two
    triangles meet; and the sums of the normals there, float64 (e, 3).
    """
    sides = sides_by_edge(indices)
    first, count = sides.first, sides.count
    one, two = sides.side[first] // 3, sides.side[first + count - 1] // 3
    turn = np.arccos(np.clip((normals[one] * normals[two]).sum(axis=1), -1.0, 1.0))
    turn[count != 2] = -1.0
    crease = (turn > MIN_CREASE_RADIANS) | (count != 2)
    edges = np.column_stack([sides.low[first], sides.high[first]])
    return edges[crease], turn[crease], (normals[one] + normals[two])[crease]


def _pairs(corner: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return all ordered pairs of different lines of one corner, as indices into the sorted int64 (n,) `corner`.

    Corners of more than MAX_LINES_PER_CORNER lines are left out.
    """
    first = np.flatnonzero(np.r_[True, corner[1:] != corner[:-1]][: len(corner)])
    count = np.diff(np.r_[first, len(corner)])
    count[count > MAX_LINES_PER_CORNER] = 0
    start = np.repeat(first, count**2)
    width = np.repeat(count, count**2)
    number = np.arange(len(start)) - np.repeat(np.cumsum(count**2) - count**2, count**2)
    one, two = start + number // width, start + number % width
    return one[one != two], two[one != two]


def _first_of_corner(corner: np.ndarray, kinds: FloatArray) -> np.ndarray:
    """Return the indices of the frames of each corner that have its first kind, ascending by corner."""
    order = np.lexsort((*kinds.T[::-1], corner))
    ordered = corner[order]
    starts = np.flatnonzero(np.r_[True, ordered[1:] != ordered[:-1]][: len(ordered)])
    leader = np.repeat(order[starts], np.diff(np.r_[starts, len(order)]))
    chosen: np.ndarray = order[(kinds[order] == kinds[leader]).all(axis=1)]
    return chosen
