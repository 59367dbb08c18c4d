"""Triangle corners welded by position, and the edges in which welded triangles meet."""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from stages.shape.arrays import FloatArray, IntArray

HASH_MULTIPLIER = -7046029254386353131
"""An odd number of about half one bits, from the golden ratio: products differ in their high bits."""


def weld(corners: FloatArray, tolerance: float) -> tuple[IntArray, FloatArray]:
    """Merge the corners of triangles (f, 3, 3) at equal positions.

    tolerance: distance up to which corners are about the same; 0 for equal coordinates alone

    Returns the vertex of each corner, int32 (f, 3), and the vertices, float64 (v, 3), in lexicographic order. Hashing
    is five times as fast as sorting all corners as long as vertices are few per corner.
    """
    points = corners.reshape(-1, 3)
    rounded = _rounded(points, tolerance)
    place, first = _numbered(np.ascontiguousarray(rounded).view(np.int64))
    order = np.lexsort(rounded[first].T[::-1])
    number = np.empty(len(order), dtype=np.int32)
    number[order] = np.arange(len(order), dtype=np.int32)
    return number[place].reshape(-1, 3), points[first[order]]


def _rounded(points: FloatArray, tolerance: float) -> FloatArray:
    """Round points (n, 3) to a lattice of `tolerance`, where points of one vertex are equal."""
    rounded: FloatArray = np.round(points / tolerance) + 0.0 if tolerance else points + 0.0
    return rounded


class WeldedSurface:
    """Triangles (f, 3, 3) that are welded once and serve many meshes, each of some of them and few others."""

    def __init__(self, corners: FloatArray, tolerance: float) -> None:
        self._points = corners.reshape(-1, 3)
        self._tolerance = tolerance
        self._places, vertices = weld(corners, tolerance)
        self._rows = _rounded(vertices, tolerance)

    def around(self, first: IntArray, others: FloatArray, last: IntArray) -> tuple[IntArray, FloatArray]:
        """Weld the triangles with indices `first` (n,), then `others` (m, 3, 3), then those with indices `last`.

        Returns the same as `weld` does of these triangles.
        """
        places, vertices = weld(others, self._tolerance)
        rows = _rounded(vertices, self._tolerance)
        faces, source = _merged(self._places, self._rows, first, places, rows, last)
        own = source >= 0
        merged = np.empty((len(source), 3))
        merged[own], merged[~own] = self._points[source[own]], vertices[-1 - source[~own]]
        return faces, merged

    def box(self, first: IntArray, others: FloatArray, last: IntArray) -> FloatArray:
        """Return the lowest and the highest corner of the box around the same triangles, float64 (2, 3)."""
        box = np.array([np.full(3, np.inf), np.full(3, -np.inf)])
        for chosen in (first, last):
            _stretch(self._points, chosen, box)
        _stretch(others.reshape(-1, 3), np.arange(len(others), dtype=np.int32), box)
        return box


@dataclass(frozen=True)
class Sides:
    """Sides of triangles in the order of their edges; sides of one edge in the order of the triangles.

    Sides without length are left out.

    low, high: int64 (s,), the vertices of the edge
    side: int64 (s,), `3 * triangle + k` for the side from corner k to the next
    first, count: int64 (e,), where the sides of each edge begin, and how many it has
    """

    low: np.ndarray
    high: np.ndarray
    side: np.ndarray
    first: np.ndarray
    count: np.ndarray


def sides_by_edge(indices: IntArray) -> Sides:
    """Sort the sides of welded triangles (f, 3) by edge."""
    start, end = indices.reshape(-1).astype(np.int64), np.roll(indices, -1, axis=1).reshape(-1).astype(np.int64)
    low, high = np.minimum(start, end), np.maximum(start, end)
    order = np.argsort(low << 32 | high, kind="stable")
    order = order[low[order] != high[order]]
    low, high = low[order], high[order]
    first = np.flatnonzero(np.r_[True, (low[1:] != low[:-1]) | (high[1:] != high[:-1])][: len(low)])
    return Sides(low, high, order, first, np.diff(np.r_[first, len(low)]))


@numba.njit(cache=True)
def _numbered(rows):
    """Number the distinct rows of int64 (n, 3) in the order of their first occurrence.

    Returns the number of each row, int32 (n,), and the first row of each number, int64.
    """
    room = 16
    while room < 2 * len(rows):
        room *= 2
    table = np.full(room, -1, dtype=np.int32)
    number, first = np.empty(len(rows), dtype=np.int32), np.empty(len(rows), dtype=np.int64)
    total = 0
    for n in range(len(rows)):
        code = np.int64(0)
        for d in range(3):
            code = (code ^ rows[n, d]) * HASH_MULTIPLIER
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
        number[n] = table[slot]
    return number, first[:total].copy()


@numba.njit(cache=True)
def _merged(places, rows, first, others, other_rows, last):
    """Merge the vertices of triangles `first`, `others` and `last` in lexicographic order.

    places: int32 (f, 3), welded triangles, from which `first` and `last` are indices
    rows, other_rows: float64 (v, 3) and (w, 3), rounded positions of vertices, ascending
    others: int32 (m, 3), triangles of the other vertices

    Returns the triangles, int32 (n, 3), and where each vertex comes first, int64: a corner of the surface, or
    `-1 - index` of another vertex.
    """
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
    """Stretch a box (2, 3) so that it contains the triangles with indices `chosen`; points (3 f, 3)."""
    for triangle in chosen:
        for corner in range(3 * triangle, 3 * triangle + 3):
            for d in range(3):
                box[0, d], box[1, d] = min(box[0, d], points[corner, d]), max(box[1, d], points[corner, d])


@numba.njit(cache=True)
def _before(one, other):
    """Return whether a point comes before another in lexicographic order."""
    for d in range(3):
        if one[d] != other[d]:
            return one[d] < other[d]
    return False
