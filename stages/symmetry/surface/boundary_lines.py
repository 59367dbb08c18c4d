"""Boundary lines of a surface: sides of triangles beyond which their planes do not go on (symmetry §4)."""

from __future__ import annotations

import numba
import numpy as np

from stages.shape.arrays import BoolArray, FloatArray
from stages.symmetry.surface.lattice import cell_index, cell_of, doubled
from stages.symmetry.surface.welding import sides_by_edge, weld

SAME_ANGLE = 5e-3
"""Radians up to which directions are one."""
ACROSS = 2e-3
"""So far beyond a side of a triangle, as a share of a cell, its plane must go on for the side to be no boundary."""
BROAD = 10 * ACROSS
"""A triangle is no sliver if it is higher than this share of a cell."""
GAP = 0.05
"""Pieces of a side that are bare for less, as a share of a cell, are none: in a sharp corner its line lies beyond the
other side too."""


@numba.njit(cache=True)
def boundary_lines(corners, normals, origin, size, keys, starts, owner, tolerance, goes_on):
    """Cell, point, direction and length of each piece of a boundary, cut by the cells, lines that are one once.

    goes_on: bool (f, 3), sides beyond which the surface is known to go on (`sides_that_go_on`); they are not looked at.
    Where a side is covered is found out to the point: what is covered in part must be a boundary of one length in
    whatever way cells cut it.
    """
    room = 4 * len(corners) + 16
    cell, points, directions, lengths = (
        np.empty(room, dtype=np.int64),
        np.empty((room, 3)),
        np.empty((room, 3)),
        np.empty(room),
    )
    total = 0
    here, times, bare = np.empty(3, dtype=np.int64), np.empty(64), np.empty((64, 2))
    spans, inward = np.empty((np.diff(starts).max(), 2)), _inward(corners, normals)
    for face in range(len(corners)):
        for k in range(3):
            if goes_on[face, k]:
                continue
            start, way = corners[face, k], corners[face, (k + 1) % 3] - corners[face, k]
            length = np.sqrt((way * way).sum())
            if length <= tolerance:
                continue
            times, crossed = _crossings(start, way, origin, size, times)
            beyond = start + ACROSS * size * np.cross(way / length, normals[face])
            filled = 0
            for piece in range(crossed - 1):
                near, far = times[piece], times[piece + 1]
                if far <= near:
                    continue
                cell_of(beyond + (near + far) / 2 * way, origin, size, here)
                n = cell_index(keys, here[0], here[1], here[2])
                count = 0
                if n >= 0:
                    count = _covered(
                        beyond, way, near, far, normals[face], n, corners, normals, inward, starts, owner,
                        ACROSS / 10 * size, tolerance, spans,
                    )  # fmt: skip
                bare, filled = _bare(near, far, spans, count, bare, filled)
            for each in range(filled):
                low, high = bare[each]
                if (high - low) * length <= GAP * size and high - low < 1:
                    continue
                for piece in range(crossed - 1):
                    near, far = max(low, times[piece]), min(high, times[piece + 1])
                    if (far - near) * length <= tolerance:
                        continue
                    middle = start + (near + far) / 2 * way
                    cell_of(middle, origin, size, here)
                    n = cell_index(keys, here[0], here[1], here[2])
                    if n < 0:
                        continue
                    if total == len(cell):
                        cell, points = doubled(cell), doubled(points)
                        directions, lengths = doubled(directions), doubled(lengths)
                    cell[total], points[total], directions[total] = n, middle, way / length
                    lengths[total] = (far - near) * length
                    total += 1
    order = np.argsort(cell[:total], kind="mergesort")
    return _merged(cell[order], points[order], directions[order], lengths[order], tolerance)


def sides_that_go_on(corners: FloatArray, normals: FloatArray, size: float) -> BoolArray:
    """Which sides of triangles (f, 3, 3) with these normals they share with one other triangle, which lies in their
    plane and is no sliver, bool (f, 3): the inner sides of a flat face that is subdivided."""
    places, _ = weld(corners, 0.0)
    sides = sides_by_edge(places)
    pair = sides.first[sides.count == 2]
    one, other = sides.side[pair], sides.side[pair + 1]
    # a side that both triangles go the same way lies between two that fold back, or lie one upon the other
    fits = places.reshape(-1)[one] != places.reshape(-1)[other]
    fits &= np.linalg.norm(normals[one // 3] - normals[other // 3], axis=1) < SAME_ANGLE
    found = np.zeros(places.size, dtype=bool)
    for side, across in ((one[fits], other[fits]), (other[fits], one[fits])):
        found[side] = _heights(corners, across) > BROAD * size
    return found.reshape(-1, 3)


def _heights(corners: FloatArray, sides: np.ndarray) -> FloatArray:
    """How far from each of `sides`, int64 (s,), the third corner of its triangle is, float64 (s,)."""
    face, k = sides // 3, sides % 3
    start, end, top = (corners[face, (k + turn) % 3] for turn in range(3))
    found: FloatArray = np.linalg.norm(np.cross(end - start, top - start), axis=1) / np.linalg.norm(end - start, axis=1)
    return found


@numba.njit(cache=True)
def _covered(start, way, near, far, normal, n, corners, normals, inward, starts, owner, slack, tolerance, spans):
    """Where, between shares `near` and `far` of a line through cell `n`, triangles of this normal lie at the line, into
    `spans` (m, 2); their number."""
    count = 0
    middle = (near + far) / 2
    for place in range(starts[n], starts[n + 1]):
        face = owner[place]
        apart, off = 0.0, 0.0
        for d in range(3):
            apart += (normal[d] - normals[face, d]) ** 2
            off += normals[face, d] * (start[d] + middle * way[d] - corners[face, 0, d])
        if apart > SAME_ANGLE**2 or abs(off) > tolerance:
            continue
        low, high = near, far
        for k in range(3):
            at, rise = slack * inward[face, k, 3], 0.0
            for d in range(3):
                at += inward[face, k, d] * (start[d] - corners[face, k, d])
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
    """For each side of each triangle the vector into the triangle that is as long as the side, and its length."""
    found = np.empty((len(corners), 3, 4))
    for face in range(len(corners)):
        for k in range(3):
            edge = corners[face, (k + 1) % 3] - corners[face, k]
            found[face, k, :3] = np.cross(normals[face], edge)
            found[face, k, 3] = np.sqrt((edge * edge).sum())
    return found


@numba.njit(cache=True)
def _crossings(start, way, origin, size, times):
    """Shares of `way` at which a line leaves a cell, from 0.0 to 1.0 and ascending, into `times`, which grows; their
    number."""
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
def _bare(near, far, spans, count, bare, filled):
    """What of `near` to `far` no span covers, added to `bare` after `filled`, joined to what ends where it begins."""
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
def _merged(cell, points, directions, lengths, tolerance):
    """Lines of one cell that are one, once, each at the point of its longest piece."""
    total, begin = 0, 0
    for place in range(len(cell)):
        if total == 0 or cell[place] != cell[total - 1]:
            begin = total
        point, along, length, home = points[place].copy(), directions[place].copy(), lengths[place], cell[place]
        known = -1
        for item in range(begin, total):
            off = np.cross(along, directions[item])
            if (off * off).sum() < SAME_ANGLE**2:
                apart = np.cross(point - points[item], directions[item])
                if (apart * apart).sum() < tolerance**2:
                    known = item
                    break
        if known < 0:
            known = total
            total += 1
            cell[known], lengths[known] = home, -1.0
        if length > lengths[known]:
            lengths[known], points[known], directions[known] = length, point, along
    return cell[:total], points[:total], directions[:total]
