"""Corners of triangles at one place as one vertex, and the edges in which triangles meet there."""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from stages.shape.arrays import FloatArray, IntArray

MIX = -7046029254386353131
"""An odd number whose bits are about half ones: what is multiplied by it differs in its high bits (golden ratio)."""


def weld(corners: FloatArray, tolerance: float) -> tuple[IntArray, FloatArray]:
    """The vertex of each corner of triangles (f, 3, 3), int32 (f, 3), and the vertices, float64 (v, 3), in
    lexicographic order. Points closer than about `tolerance` are one; those at equal coordinates alone where it is 0.

    By hashing: as long as vertices are few a corner, five times as fast as sorting all of them.
    """
    points = corners.reshape(-1, 3)
    rounded = _rounded(points, tolerance)
    place, first = _numbered(np.ascontiguousarray(rounded).view(np.int64))
    order = np.lexsort(rounded[first].T[::-1])
    number = np.empty(len(order), dtype=np.int32)
    number[order] = np.arange(len(order), dtype=np.int32)
    return number[place].reshape(-1, 3), points[first[order]]


def _rounded(points: FloatArray, tolerance: float) -> FloatArray:
    """Points (n, 3) on a lattice of `tolerance`, where they are equal if they are one vertex."""
    rounded: FloatArray = np.round(points / tolerance) + 0.0 if tolerance else points + 0.0
    return rounded


class WeldedSurface:
    """Triangles (f, 3, 3) that are welded once, for many meshes of some of them each and of little else."""

    def __init__(self, corners: FloatArray, tolerance: float) -> None:
        self._points = corners.reshape(-1, 3)
        self._tolerance = tolerance
        self._places, vertices = weld(corners, tolerance)
        self._rows = _rounded(vertices, tolerance)

    def around(self, first: IntArray, others: FloatArray, last: IntArray) -> tuple[IntArray, FloatArray]:
        """What `weld` makes of triangles at places `first` (n,), then `others` (m, 3, 3), then those at `last`."""
        places, vertices = weld(others, self._tolerance)
        rows = _rounded(vertices, self._tolerance)
        faces, source = _merged(self._places, self._rows, first, places, rows, last)
        own = source >= 0
        found = np.empty((len(source), 3))
        found[own], found[~own] = self._points[source[own]], vertices[-1 - source[~own]]
        return faces, found

    def box(self, first: IntArray, others: FloatArray, last: IntArray) -> FloatArray:
        """Lowest and highest corner of the box around the same triangles, float64 (2, 3)."""
        found = np.array([np.full(3, np.inf), np.full(3, -np.inf)])
        for chosen in (first, last):
            _stretch(self._points, chosen, found)
        _stretch(others.reshape(-1, 3), np.arange(len(others), dtype=np.int32), found)
        return found


@dataclass(frozen=True)
class Sides:
    """Sides of triangles in the order of the edges that they lie in, int64 (s,) each; of an edge in that of triangles.

    low, high: the vertices of the edge; side: `3 * triangle + k`, from corner k to the next. first, count: int64 (e,),
    of each edge where its sides begin, and how many they are. Sides without length are left out.
    """

    low: np.ndarray
    high: np.ndarray
    side: np.ndarray
    first: np.ndarray
    count: np.ndarray


def sides_by_edge(places: IntArray) -> Sides:
    """The sides of triangles with vertices `places` (f, 3)."""
    start, end = places.reshape(-1).astype(np.int64), np.roll(places, -1, axis=1).reshape(-1).astype(np.int64)
    low, high = np.minimum(start, end), np.maximum(start, end)
    order = np.argsort(low << 32 | high, kind="stable")
    order = order[low[order] != high[order]]
    low, high = low[order], high[order]
    first = np.flatnonzero(np.r_[True, (low[1:] != low[:-1]) | (high[1:] != high[:-1])][: len(low)])
    return Sides(low, high, order, first, np.diff(np.r_[first, len(low)]))


@numba.njit(cache=True)
def _numbered(rows):
    """For rows int64 (n, 3) the number of each, equal ones alike, int32 (n,), and where each number comes first."""
    room = 16
    while room < 2 * len(rows):
        room *= 2
    table = np.full(room, -1, dtype=np.int32)
    place, first = np.empty(len(rows), dtype=np.int32), np.empty(len(rows), dtype=np.int64)
    total = 0
    for n in range(len(rows)):
        code = np.int64(0)
        for d in range(3):
            code = (code ^ rows[n, d]) * MIX
            code ^= code >> 32 & 0xFFFFFFFF
        slot = code & (room - 1)
        while table[slot] >= 0:
            known = first[table[slot]]
            if rows[known, 0] == rows[n, 0] and rows[known, 1] == rows[n, 1] and rows[known, 2] == rows[n, 2]:
                break
            slot = (slot + 1) & (room - 1)
        if table[slot] < 0:
            table[slot], first[total] = total, n
            total += 1
        place[n] = table[slot]
    return place, first[:total].copy()


@numba.njit(cache=True)
def _merged(places, rows, first, others, other_rows, last):
    """The vertices of triangles `first` out of `places` (f, 3), of `others` (m, 3), and of `last` out of `places`, in
    the order of both their ascending rows (v, 3) and (w, 3), equal ones once: int32 (n, 3), and where each vertex comes
    first: at which corner of the surface or, of the others, -1 less its place there."""
    corner, early = np.full(len(rows), -1, dtype=np.int64), np.zeros(len(rows), dtype=np.bool_)
    for chosen, is_early in ((first, True), (last, False)):
        for triangle in chosen:
            for k in range(3):
                vertex = places[triangle, k]
                if corner[vertex] < 0:
                    corner[vertex], early[vertex] = 3 * triangle + k, is_early
    number, other_number = np.empty(len(rows), dtype=np.int32), np.empty(len(other_rows), dtype=np.int32)
    source = np.empty(len(rows) + len(other_rows), dtype=np.int64)
    total, other = 0, 0
    for vertex in range(len(rows)):
        if corner[vertex] < 0:
            continue
        while other < len(other_rows) and _before(other_rows[other], rows[vertex]):
            other_number[other], source[total] = total, -1 - other
            total, other = total + 1, other + 1
        number[vertex], source[total] = total, corner[vertex]
        if other < len(other_rows) and not _before(rows[vertex], other_rows[other]):
            other_number[other] = total
            if not early[vertex]:
                source[total] = -1 - other
            other += 1
        total += 1
    for rest in range(other, len(other_rows)):
        other_number[rest], source[total] = total, -1 - rest
        total += 1
    faces, n = np.empty((len(first) + len(others) + len(last), 3), dtype=np.int32), 0
    for triangle in first:
        for k in range(3):
            faces[n, k] = number[places[triangle, k]]
        n += 1
    for triangle in range(len(others)):
        for k in range(3):
            faces[n, k] = other_number[others[triangle, k]]
        n += 1
    for triangle in last:
        for k in range(3):
            faces[n, k] = number[places[triangle, k]]
        n += 1
    return faces, source[:total].copy()


@numba.njit(cache=True)
def _stretch(points, chosen, box):
    """Make a box (2, 3) hold the triangles at some places, three of `points` (3 f, 3) each."""
    for triangle in chosen:
        for corner in range(3 * triangle, 3 * triangle + 3):
            for d in range(3):
                box[0, d], box[1, d] = min(box[0, d], points[corner, d]), max(box[1, d], points[corner, d])


@numba.njit(cache=True)
def _before(one, other):
    """Whether a point comes before another in lexicographic order."""
    for d in range(3):
        if one[d] != other[d]:
            return one[d] < other[d]
    return False
