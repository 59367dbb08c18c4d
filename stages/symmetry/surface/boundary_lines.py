"""Boundary lines of a surface: sides of triangles where the surface ends or turns (symmetry §4)."""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np

from stages.shape.arrays import BoolArray, FloatArray
from stages.symmetry.surface.lattice import cell_index, cell_of, doubled
from stages.symmetry.surface.welding import sides_by_edge, weld

SAME_ANGLE_RADIANS = 5e-3
"""Directions that differ by less are the same."""
PROBE_CELLS = 2e-3
"""Distance from a side, in cells, at which its plane must go on for the side to be no boundary."""
MIN_HEIGHT_CELLS = 10 * PROBE_CELLS
"""A triangle of less height, in cells, is a sliver."""
MIN_BARE_CELLS = 0.05
"""Shorter uncovered pieces of a side, in cells, are ignored: in a sharp corner its line lies beyond the other side."""


class GridTriangles(NamedTuple):
    """Triangles and the cells that they lie in.

    corners: float64 (f, 3, 3)
    normals: float64 (f, 3), unit length
    origin: float64 (3,), low corner of cell (0, 0, 0)
    size: width of a cell
    keys: int64 (n,), packed keys of the occupied cells, ascending
    starts: int64 (n + 1,), where the triangles of each cell begin in `owner`
    owner: int64 (m,), triangles by cell
    tolerance: distance up to which points are the same
    """

    corners: np.ndarray
    normals: np.ndarray
    origin: np.ndarray
    size: float
    keys: np.ndarray
    starts: np.ndarray
    owner: np.ndarray
    tolerance: float


@numba.njit(cache=True)
def boundary_lines(surface, goes_on):
    """Return cell, point, direction and length of each boundary line of each cell; equal lines of a cell once.

    surface: `GridTriangles`
    goes_on: bool (f, 3), sides beyond which the surface is known to go on (`sides_that_go_on`)

    The uncovered part of a side is found exactly, so that its length does not depend on the lattice.
    """
    corners, size, tolerance = surface.corners, surface.size, surface.tolerance
    room = 4 * len(corners) + 16
    cell, points, directions, lengths = (
        np.empty(room, dtype=np.int64),
        np.empty((room, 3)),
        np.empty((room, 3)),
        np.empty(room),
    )
    total = 0
    here, times, bare = np.empty(3, dtype=np.int64), np.empty(64), np.empty((64, 2))
    spans, inward = np.empty((np.diff(surface.starts).max(), 2)), _inward(corners, surface.normals)
    for face in range(len(corners)):
        for k in range(3):
            if goes_on[face, k]:
                continue
            start, way = corners[face, k], corners[face, (k + 1) % 3] - corners[face, k]
            length = np.sqrt((way * way).sum())
            if length <= tolerance:
                continue
            times, crossed = _crossings(start, way, surface.origin, size, times)
            beyond = start + PROBE_CELLS * size * np.cross(way / length, surface.normals[face])
            filled = np.int64(0)
            for piece in range(crossed - 1):
                near, far = times[piece], times[piece + 1]
                if far <= near:
                    continue
                cell_of(beyond + (near + far) / 2 * way, surface.origin, size, here)
                n = cell_index(surface.keys, here[0], here[1], here[2])
                count = 0
                if n >= 0:
                    count = _covered_spans(beyond, way, near, far, surface.normals[face], n, surface, inward, spans)
                bare, filled = _append_uncovered(near, far, spans, count, bare, filled)
            for span in range(filled):
                low, high = bare[span]
                if (high - low) * length <= MIN_BARE_CELLS * size and high - low < 1:
                    continue
                for piece in range(crossed - 1):
                    near, far = max(low, times[piece]), min(high, times[piece + 1])
                    if (far - near) * length <= tolerance:
                        continue
                    middle = start + (near + far) / 2 * way
                    cell_of(middle, surface.origin, size, here)
                    n = cell_index(surface.keys, here[0], here[1], here[2])
                    if n < 0:
                        continue
                    if total == len(cell):
                        cell, points = doubled(cell), doubled(points)
                        directions, lengths = doubled(directions), doubled(lengths)
                    cell[total], points[total], directions[total] = n, middle, way / length
                    lengths[total] = (far - near) * length
                    total += 1
    order = np.argsort(cell[:total], kind="mergesort")
    return _merge_lines(cell[order], points[order], directions[order], lengths[order], tolerance)


def sides_that_go_on(corners: FloatArray, normals: FloatArray, size: float) -> BoolArray:
    """Find the inner sides of flat, subdivided faces, bool (f, 3).

    Such a side is shared with exactly one other triangle, which lies in the same plane and is no sliver.
    """
    vertices, _ = weld(corners, 0.0)
    sides = sides_by_edge(vertices)
    pair = sides.first[sides.count == 2]
    one, other = sides.side[pair], sides.side[pair + 1]
    # a side that both triangles run along in the same direction lies between two that fold back or overlap
    fits = vertices.reshape(-1)[one] != vertices.reshape(-1)[other]
    fits &= np.linalg.norm(normals[one // 3] - normals[other // 3], axis=1) < SAME_ANGLE_RADIANS
    inner = np.zeros(vertices.size, dtype=bool)
    for side, across in ((one[fits], other[fits]), (other[fits], one[fits])):
        inner[side] = _heights(corners, across) > MIN_HEIGHT_CELLS * size
    return inner.reshape(-1, 3)


def _heights(corners: FloatArray, sides: np.ndarray) -> FloatArray:
    """Return the height of each triangle above its side int64 (s,), float64 (s,)."""
    face, k = sides // 3, sides % 3
    start, end, top = (corners[face, (k + turn) % 3] for turn in range(3))
    cross = np.linalg.norm(np.cross(end - start, top - start), axis=1)
    heights: FloatArray = cross / np.linalg.norm(end - start, axis=1)
    return heights


@numba.njit(cache=True)
def _covered_spans(start, way, near, far, normal, n, surface, inward, spans):
    """Write the spans of a line that triangles with this normal cover into `spans` (m, 2); return their number.

    The line runs from shares `near` to `far` of `way` through cell `n`.
    """
    count = 0
    middle = (near + far) / 2
    slack = PROBE_CELLS / 10 * surface.size
    for place in range(surface.starts[n], surface.starts[n + 1]):
        face = surface.owner[place]
        squared, off = 0.0, 0.0
        for d in range(3):
            squared += (normal[d] - surface.normals[face, d]) ** 2
            off += surface.normals[face, d] * (start[d] + middle * way[d] - surface.corners[face, 0, d])
        if squared > SAME_ANGLE_RADIANS**2 or abs(off) > surface.tolerance:
            continue
        low, high = near, far
        for k in range(3):
            at, rise = slack * inward[face, k, 3], 0.0
            for d in range(3):
                at += inward[face, k, d] * (start[d] - surface.corners[face, k, d])
                rise += inward[face, k, d] * way[d]
            if rise == 0.0:
                if at < 0:
                    high = low
            elif rise > 0:
                low = max(low, -at / rise)
            else:
                high = min(high, -at / rise)
        if low < high and count < len(spans):
            spans[count, 0], spans[count, 1] = low, high
            count += 1
    return count


@numba.njit(cache=True)
def _inward(corners, normals):
    """Return, for each side of each triangle, the inward vector of the side's length, and that length."""
    vectors = np.empty((len(corners), 3, 4))
    for face in range(len(corners)):
        for k in range(3):
            edge = corners[face, (k + 1) % 3] - corners[face, k]
            vectors[face, k, :3] = np.cross(normals[face], edge)
            vectors[face, k, 3] = np.sqrt((edge * edge).sum())
    return vectors


@numba.njit(cache=True)
def _crossings(start, way, origin, size, times):
    """Write the shares of `way` at which a line leaves a cell, from 0.0 to 1.0 ascending, into `times`.

    Returns `times`, which may grow, and how many shares there are.
    """
    filled = 2
    for axis in range(3):
        one, two = (start[axis] - origin[axis]) / size, (start[axis] + way[axis] - origin[axis]) / size
        filled += abs(int(np.floor(two)) - int(np.floor(one)))
    if filled > len(times):
        times = np.empty(2 * filled)
    times[0], times[1] = 0.0, 1.0
    filled = 2
    for axis in range(3):
        one, two = start[axis], start[axis] + way[axis]
        low, high = np.floor((min(one, two) - origin[axis]) / size), np.floor((max(one, two) - origin[axis]) / size)
        for border in range(int(low) + 1, int(high) + 1):
            times[filled] = (origin[axis] + border * size - one) / (two - one)
            filled += 1
    times[:filled].sort()
    return times, filled


@numba.njit(cache=True)
def _append_uncovered(near, far, spans, count, bare, filled):
    """Append what no span covers between `near` and `far` to `bare`; join it to a piece that ends where it begins."""
    order = np.argsort(spans[:count, 0])
    at = near
    for place in range(count + 1):
        until = spans[order[place], 0] if place < count else far
        if until > at:
            if filled and bare[filled - 1, 1] >= at:
                bare[filled - 1, 1] = until
            else:
                if filled == len(bare):
                    bare = doubled(bare)
                bare[filled, 0], bare[filled, 1] = at, until
                filled += 1
        if place < count:
            at = max(at, spans[order[place], 1])
    return bare, filled


@numba.njit(cache=True)
def _merge_lines(cell, points, directions, lengths, tolerance):
    """Merge equal lines of one cell; a merged line has the point of its longest piece."""
    total, begin = 0, 0
    for place in range(len(cell)):
        if total == 0 or cell[place] != cell[total - 1]:
            begin = total
        point, along, length, home = points[place].copy(), directions[place].copy(), lengths[place], cell[place]
        known = -1
        for item in range(begin, total):
            off = np.cross(along, directions[item])
            if (off * off).sum() < SAME_ANGLE_RADIANS**2:
                across = np.cross(point - points[item], directions[item])
                if (across * across).sum() < tolerance**2:
                    known = item
                    break
        if known < 0:
            known = total
            total += 1
            cell[known], lengths[known] = home, -1.0
        if length > lengths[known]:
            lengths[known], points[known], directions[known] = length, point, along
    return cell[:total], points[:total], directions[:total]
