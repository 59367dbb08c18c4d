"""Triangles cut along the cells of a cubic lattice (symmetry §4)."""

from __future__ import annotations

import numba
import numpy as np

from stages.shape.arrays import BoolArray, FloatArray, IntArray
from stages.symmetry.surface.lattice import doubled

MOST_CORNERS = 12
"""A triangle cut by six planes has at most nine corners."""
SPECK = 1e-9
"""Fragments below this share of a cell's face are rounding."""
EVERYWHERE = np.array([[-(2**62)] * 3, [2**62] * 3])
"""A box that holds all cells."""


@numba.njit(cache=True)
def _half(polygon, count, axis, bound, sign, out):
    """The part of a polygon beyond a plane across an axis, or before it where `sign` is -1.0, into `out`; its number of
    corners."""
    kept = 0
    for k in range(count):
        here, after = polygon[k], polygon[(k + 1) % count]
        one, two = sign * (here[axis] - bound), sign * (after[axis] - bound)
        if one >= 0:
            out[kept] = here
            kept += 1
        if (one >= 0) != (two >= 0):
            share = one / (one - two)
            for d in range(3):
                out[kept, d] = here[d] + share * (after[d] - here[d])
            out[kept, axis] = bound
            kept += 1
    return kept


@numba.njit(cache=True)
def _slab(polygon, count, axis, low, high, spare, out):
    """The part of a polygon between two planes across an axis, into `out`; its number of corners."""
    return _half(spare, _half(polygon, count, axis, low, 1.0, spare), axis, high, -1.0, out)


@numba.njit(cache=True)
def _area(polygon, count):
    x, y, z = 0.0, 0.0, 0.0
    for k in range(1, count - 1):
        a0, a1, a2 = polygon[k, 0] - polygon[0, 0], polygon[k, 1] - polygon[0, 1], polygon[k, 2] - polygon[0, 2]
        b0, b1, b2 = (
            polygon[k + 1, 0] - polygon[0, 0],
            polygon[k + 1, 1] - polygon[0, 1],
            polygon[k + 1, 2] - polygon[0, 2],
        )
        x, y, z = x + a1 * b2 - a2 * b1, y + a2 * b0 - a0 * b2, z + a0 * b1 - a1 * b0
    return 0.5 * np.sqrt(x * x + y * y + z * z)


@numba.njit(cache=True)
def _reach(polygon, count, axis, origin, size):
    """First and last cell of a polygon along an axis."""
    low, high = polygon[0, axis], polygon[0, axis]
    for k in range(1, count):
        low, high = min(low, polygon[k, axis]), max(high, polygon[k, axis])
    return int(np.floor((low - origin[axis]) / size)), int(np.floor((high - origin[axis]) / size))


@numba.njit(cache=True)
def _all_fragments(corners, origin, size, low_cell, high_cell):
    cells = np.empty((4 * len(corners) + 16, 3), dtype=np.int64)
    faces = np.empty(4 * len(corners) + 16, dtype=np.int64)
    middles = np.empty((4 * len(corners) + 16, 4))
    total = np.int64(0)
    # not plain numbers: constants have types of their own, for which all that is called would be compiled once more
    x, y, z, three = np.int64(0), np.int64(1), np.int64(2), np.int64(3)
    spare, whole = np.empty((MOST_CORNERS, 3)), np.empty((MOST_CORNERS, 3))
    of_x, of_y, of_z = np.empty((MOST_CORNERS, 3)), np.empty((MOST_CORNERS, 3)), np.empty((MOST_CORNERS, 3))
    for face in range(len(corners)):
        whole[:3] = corners[face]
        first_i, last_i = _reach(whole, three, x, origin, size)
        for i in range(max(first_i, low_cell[0]), min(last_i, high_cell[0]) + 1):
            low = origin[0] + i * size
            in_x = _slab(whole, three, x, low, low + size, spare, of_x)
            if in_x < 3:
                continue
            first_j, last_j = _reach(of_x, in_x, y, origin, size)
            for j in range(max(first_j, low_cell[1]), min(last_j, high_cell[1]) + 1):
                low = origin[1] + j * size
                in_y = _slab(of_x, in_x, y, low, low + size, spare, of_y)
                if in_y < 3:
                    continue
                first_k, last_k = _reach(of_y, in_y, z, origin, size)
                for k in range(max(first_k, low_cell[2]), min(last_k, high_cell[2]) + 1):
                    low = origin[2] + k * size
                    in_z = _slab(of_y, in_y, z, low, low + size, spare, of_z)
                    area = _area(of_z, in_z) if in_z > 2 else 0.0
                    if area <= SPECK * size * size:
                        continue
                    if total == len(faces):
                        cells, faces, middles = doubled(cells), doubled(faces), doubled(middles)
                    cells[total, 0], cells[total, 1], cells[total, 2] = i, j, k
                    faces[total] = face
                    for axis in range(3):
                        middles[total, axis] = of_z[:in_z, axis].mean()
                    middles[total, 3] = area
                    total += 1
    return cells[:total], faces[:total], middles[:total]


def fragments(
    corners: FloatArray, origin: FloatArray, size: float, box: np.ndarray = EVERYWHERE
) -> tuple[np.ndarray, np.ndarray, FloatArray]:
    """The pieces into which cells cut triangles `corners` (f, 3, 3), in the triangles' order; of cells from `box[0]` to
    `box[1]`, int64 (2, 3), alone.

    Cell of each piece, int64 (m, 3); its triangle, int64 (m,); a point inside it and its area, float64 (m, 4). Cell
    (i, j, k) lies between `origin + size * (i, j, k)` and the same of (i + 1, j + 1, k + 1).
    """
    found: tuple[np.ndarray, np.ndarray, FloatArray] = _all_fragments(
        np.ascontiguousarray(corners), origin, size, box[0], box[1]
    )
    return found


@numba.njit(cache=True)
def _emit(polygon, count, size, side, face, triangles, sides, faces, total):
    """Add a polygon as a fan of triangles."""
    if count < 3 or _area(polygon, count) <= SPECK * size * size:
        return triangles, sides, faces, total
    for k in range(1, count - 1):
        if total == len(faces):
            triangles, sides, faces = doubled(triangles), doubled(sides), doubled(faces)
        triangles[total, 0], triangles[total, 1], triangles[total, 2] = polygon[0], polygon[k], polygon[k + 1]
        sides[total], faces[total] = side, face
        total += 1
    return triangles, sides, faces, total


@numba.njit(cache=True)
def _sides_along(
    cells, inside, begin, end, axis, i, j, first, last, found, polygon, count, origin, size, box, spare, out
):
    """For each cell layer of a polygon along an axis whether its fragments lie outside (0), inside (1), on both sides
    (2) or are none (-1); with `i` and `j` of fragments in that layer (and row) alone. Beyond the box there is no
    fragment, and all is outside."""
    found[: last - first + 1] = -1
    for place in range(begin, end):
        if (axis > 0 and cells[place, 0] != i) or (axis > 1 and cells[place, 1] != j):
            continue
        layer = cells[place, axis] - first
        if layer < 0 or layer > last - first:
            continue
        side = 1 if inside[place] else 0
        found[layer] = side if found[layer] in (-1, side) else 2
    for layer in range(last - first + 1):
        if not box[0, axis] <= first + layer <= box[1, axis]:
            found[layer] = 0
    for other in range(axis + 1, 3):
        low, high = _reach(polygon, count, other, origin, size)
        if low >= box[0, other] and high <= box[1, other]:
            continue
        for layer in range(last - first + 1):
            if found[layer] == 1:
                start = origin[axis] + (first + layer) * size
                held = _slab(polygon, count, axis, start, start + size, spare, out)
                if held > 2:
                    low, high = _reach(out, held, other, origin, size)
                    if low < box[0, other] or high > box[1, other]:
                        found[layer] = 2


@numba.njit(cache=True)
def _run(found, start, count):
    """Where the run of layers of one side ends that begins at `start`, and its side; layers on both sides stand alone,
    layers without fragments go with what is before them."""
    side = found[start]
    after = start + 1
    while side != 2 and after < count and (found[after] in (-1, side) or side == -1):
        side = max(side, found[after])
        if side == 2:
            return after, -1
        after += 1
    return after, side


@numba.njit(cache=True)
def _all_cuts(corners, origin, size, cells, owner_starts, inside, box):
    triangles = np.empty((4 * len(corners) + 16, 3, 3))
    sides, faces = np.empty(len(triangles), dtype=np.int64), np.empty(len(triangles), dtype=np.int64)
    total = np.int64(0)
    x, y, z, three = np.int64(0), np.int64(1), np.int64(2), np.int64(3)  # as in _all_fragments
    spare, whole = np.empty((MOST_CORNERS, 3)), np.empty((MOST_CORNERS, 3))
    of_x, of_y, of_z = np.empty((MOST_CORNERS, 3)), np.empty((MOST_CORNERS, 3)), np.empty((MOST_CORNERS, 3))
    for face in range(len(corners)):
        whole[:3] = corners[face]
        begin, end = owner_starts[face], owner_starts[face + 1]
        first_i, last_i = _reach(whole, three, x, origin, size)
        along_x = np.empty(last_i - first_i + 1, dtype=np.int64)
        _sides_along(
            cells, inside, begin, end, x, x, x, first_i, last_i, along_x, whole, three, origin, size, box, spare, of_x
        )
        start_x = np.int64(0)
        while start_x < len(along_x):
            end_x, side = _run(along_x, start_x, len(along_x))
            low = origin[0] + (first_i + start_x) * size
            in_x = _slab(whole, three, x, low, origin[0] + (first_i + end_x) * size, spare, of_x)
            i = first_i + start_x
            start_x = end_x
            if side != 2:
                triangles, sides, faces, total = _emit(of_x, in_x, size, side, face, triangles, sides, faces, total)
                continue
            if in_x < 3:
                continue
            first_j, last_j = _reach(of_x, in_x, y, origin, size)
            along_y = np.empty(last_j - first_j + 1, dtype=np.int64)
            _sides_along(
                cells, inside, begin, end, y, i, x, first_j, last_j, along_y, of_x, in_x, origin, size, box, spare, of_y
            )
            start_y = np.int64(0)
            while start_y < len(along_y):
                end_y, side = _run(along_y, start_y, len(along_y))
                low = origin[1] + (first_j + start_y) * size
                in_y = _slab(of_x, in_x, y, low, origin[1] + (first_j + end_y) * size, spare, of_y)
                j = first_j + start_y
                start_y = end_y
                if side != 2:
                    triangles, sides, faces, total = _emit(of_y, in_y, size, side, face, triangles, sides, faces, total)
                    continue
                if in_y < 3:
                    continue
                first_k, last_k = _reach(of_y, in_y, z, origin, size)
                along_z = np.empty(last_k - first_k + 1, dtype=np.int64)
                _sides_along(
                    cells, inside, begin, end, z, i, j, first_k, last_k, along_z,
                    of_y, in_y, origin, size, box, spare, of_z,
                )  # fmt: skip
                start_z = np.int64(0)
                while start_z < len(along_z):
                    end_z, side = _run(along_z, start_z, len(along_z))
                    low = origin[2] + (first_k + start_z) * size
                    in_z = _slab(of_y, in_y, z, low, origin[2] + (first_k + end_z) * size, spare, of_z)
                    start_z = end_z
                    triangles, sides, faces, total = _emit(of_z, in_z, size, side, face, triangles, sides, faces, total)
    return triangles[:total], sides[:total], faces[:total]


def cut_triangles(
    corners: FloatArray,
    origin: FloatArray,
    size: float,
    cells: np.ndarray,
    faces: np.ndarray,
    inside: BoolArray,
    box: np.ndarray,
) -> tuple[FloatArray, BoolArray, IntArray]:
    """Triangles cut where cells that are inside meet cells that are not, and nowhere else.

    corners: float64 (f, 3, 3), each with something on both sides; cells int64 (m, 3) and faces int64 (m,) of their
    `fragments` in `box` int64 (2, 3), of which bool (m,) `inside` says the side; beyond the box all is outside. Returns
    triangles float64 (t, 3, 3), their side and the triangle that each is of, int32 (t,).
    """
    starts = np.searchsorted(faces, np.arange(len(corners) + 1))
    triangles, sides, owners = _all_cuts(np.ascontiguousarray(corners), origin, size, cells, starts, inside, box)
    return triangles, sides == 1, owners.astype(np.int32)
