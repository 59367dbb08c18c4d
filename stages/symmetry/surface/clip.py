"""Triangles cut along the cells of a cubic lattice (symmetry §4)."""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np

from stages.shape.arrays import BoolArray, FloatArray, IntArray
from stages.symmetry.surface.lattice import doubled

MAX_CORNERS = 12
"""Room for the corners of a clipped triangle; a triangle cut by six planes has at most nine."""
MIN_FRAGMENT_SHARE = 1e-9
"""Fragments below this share of a cell's face are rounding errors."""
ALL_CELLS = np.array([[-(2**62)] * 3, [2**62] * 3])
"""A box that contains every cell."""

SIDE_OUT, SIDE_IN, BOTH_SIDES, NO_FRAGMENT = 0, 1, 2, -1
"""Where the fragments of a layer of cells lie."""


class _Fragments(NamedTuple):
    """What `_all_cuts` knows of the fragments of some triangles.

    origin: float64 (3,), low corner of cell (0, 0, 0)
    size: width of a cell
    cells: int64 (m, 3), cell of each fragment
    inside: bool (m,), side of each fragment
    starts: int64 (f + 1,), where the fragments of each triangle begin
    box: int64 (2, 3), lowest and highest cell with fragments
    """

    origin: np.ndarray
    size: float
    cells: np.ndarray
    inside: np.ndarray
    starts: np.ndarray
    box: np.ndarray


class _Triangles(NamedTuple):
    """Growing arrays of output triangles: corners float64 (t, 3, 3), sides int64 (t,), source faces int64 (t,)."""

    corners: np.ndarray
    sides: np.ndarray
    faces: np.ndarray


@numba.njit(cache=True)
def _clip_half(polygon, count, axis, bound, sign, out):
    """Write the part of a polygon above a plane across an axis (below it if `sign` is -1.0) into `out`.

    Returns the number of corners.
    """
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
def _clip_slab(polygon, count, axis, low, high, spare, out):
    """Write the part of a polygon between two planes across an axis into `out`; return its number of corners."""
    return _clip_half(spare, _clip_half(polygon, count, axis, low, 1.0, spare), axis, high, -1.0, out)


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
def _cell_range(polygon, count, axis, origin, size):
    """Return the first and the last cell of a polygon along an axis."""
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
    # typed integers: a literal has a type of its own, and every function called with it would be compiled again
    x, y, z, three = np.int64(0), np.int64(1), np.int64(2), np.int64(3)
    spare, whole = np.empty((MAX_CORNERS, 3)), np.empty((MAX_CORNERS, 3))
    of_x, of_y, of_z = np.empty((MAX_CORNERS, 3)), np.empty((MAX_CORNERS, 3)), np.empty((MAX_CORNERS, 3))
    for face in range(len(corners)):
        whole[:3] = corners[face]
        first_i, last_i = _cell_range(whole, three, x, origin, size)
        for i in range(max(first_i, low_cell[0]), min(last_i, high_cell[0]) + 1):
            low = origin[0] + i * size
            in_x = _clip_slab(whole, three, x, low, low + size, spare, of_x)
            if in_x < 3:
                continue
            first_j, last_j = _cell_range(of_x, in_x, y, origin, size)
            for j in range(max(first_j, low_cell[1]), min(last_j, high_cell[1]) + 1):
                low = origin[1] + j * size
                in_y = _clip_slab(of_x, in_x, y, low, low + size, spare, of_y)
                if in_y < 3:
                    continue
                first_k, last_k = _cell_range(of_y, in_y, z, origin, size)
                for k in range(max(first_k, low_cell[2]), min(last_k, high_cell[2]) + 1):
                    low = origin[2] + k * size
                    in_z = _clip_slab(of_y, in_y, z, low, low + size, spare, of_z)
                    area = _area(of_z, in_z) if in_z > 2 else 0.0
                    if area <= MIN_FRAGMENT_SHARE * size * size:
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
    corners: FloatArray, origin: FloatArray, size: float, box: np.ndarray = ALL_CELLS
) -> tuple[np.ndarray, np.ndarray, FloatArray]:
    """Cut triangles along the cells of a lattice.

    corners: float64 (f, 3, 3)
    origin: float64 (3,); cell (i, j, k) begins at `origin + size * (i, j, k)`
    box: int64 (2, 3), lowest and highest cell to return

    Returns, in the order of the triangles, the cell of each fragment, int64 (m, 3); its triangle, int64 (m,); a point
    inside it and its area, float64 (m, 4).
    """
    cut: tuple[np.ndarray, np.ndarray, FloatArray] = _all_fragments(
        np.ascontiguousarray(corners), origin, size, box[0], box[1]
    )
    return cut


@numba.njit(cache=True)
def _emit(polygon, count, size, side, face, output, total):
    """Append a polygon to the output as a fan of triangles; return the output and its length."""
    if count < 3 or _area(polygon, count) <= MIN_FRAGMENT_SHARE * size * size:
        return output, total
    for k in range(1, count - 1):
        if total == len(output.faces):
            output = _Triangles(doubled(output.corners), doubled(output.sides), doubled(output.faces))
        triangle = output.corners[total]
        triangle[0], triangle[1], triangle[2] = polygon[0], polygon[k], polygon[k + 1]
        output.sides[total], output.faces[total] = side, face
        total += 1
    return output, total


@numba.njit(cache=True)
def _layer_sides(known, face, axis, i, j, first, last, polygon, count, spare, out):
    """Return the side of each layer of cells from `first` to `last` along an axis, int64 (last - first + 1,).

    A layer is SIDE_OUT, SIDE_IN, on BOTH_SIDES, or has NO_FRAGMENT. Across the second axis only fragments with first
    index `i` count, across the third also only those with second index `j`. Cells beyond the box are SIDE_OUT.
    """
    sides = np.full(last - first + 1, NO_FRAGMENT, dtype=np.int64)
    for fragment in range(known.starts[face], known.starts[face + 1]):
        if (axis > 0 and known.cells[fragment, 0] != i) or (axis > 1 and known.cells[fragment, 1] != j):
            continue
        layer = known.cells[fragment, axis] - first
        if layer < 0 or layer > last - first:
            continue
        side = SIDE_IN if known.inside[fragment] else SIDE_OUT
        sides[layer] = side if sides[layer] in (NO_FRAGMENT, side) else BOTH_SIDES
    for layer in range(last - first + 1):
        if not known.box[0, axis] <= first + layer <= known.box[1, axis]:
            sides[layer] = SIDE_OUT
    for other in range(axis + 1, 3):
        low, high = _cell_range(polygon, count, other, known.origin, known.size)
        if low >= known.box[0, other] and high <= known.box[1, other]:
            continue
        for layer in range(last - first + 1):
            if sides[layer] == SIDE_IN:
                start = known.origin[axis] + (first + layer) * known.size
                corners = _clip_slab(polygon, count, axis, start, start + known.size, spare, out)
                if corners > 2:
                    low, high = _cell_range(out, corners, other, known.origin, known.size)
                    if low < known.box[0, other] or high > known.box[1, other]:
                        sides[layer] = BOTH_SIDES
    return sides


@numba.njit(cache=True)
def _run(sides, start):
    """Return where the run of layers of one side that begins at `start` ends, and its side.

    A layer on both sides is a run of its own. Layers without fragments join the run before them.
    """
    side = sides[start]
    after = start + 1
    while side != BOTH_SIDES and after < len(sides) and (sides[after] in (NO_FRAGMENT, side) or side == NO_FRAGMENT):
        side = max(side, sides[after])
        if side == BOTH_SIDES:
            return after, NO_FRAGMENT
        after += 1
    return after, side


@numba.njit(cache=True)
def _all_cuts(corners, known):
    """Cut each triangle along x into runs of layers of one side, mixed layers along y, and mixed rows along z."""
    room = 4 * len(corners) + 16
    output = _Triangles(np.empty((room, 3, 3)), np.empty(room, dtype=np.int64), np.empty(room, dtype=np.int64))
    origin, size = known.origin, known.size
    total = np.int64(0)
    x, y, z, three = np.int64(0), np.int64(1), np.int64(2), np.int64(3)  # as in _all_fragments
    spare, whole = np.empty((MAX_CORNERS, 3)), np.empty((MAX_CORNERS, 3))
    of_x, of_y, of_z = np.empty((MAX_CORNERS, 3)), np.empty((MAX_CORNERS, 3)), np.empty((MAX_CORNERS, 3))
    for face in range(len(corners)):
        whole[:3] = corners[face]
        first_i, last_i = _cell_range(whole, three, x, origin, size)
        along_x = _layer_sides(known, face, x, x, x, first_i, last_i, whole, three, spare, of_x)
        start_x = np.int64(0)
        while start_x < len(along_x):
            end_x, side = _run(along_x, start_x)
            low = origin[0] + (first_i + start_x) * size
            in_x = _clip_slab(whole, three, x, low, origin[0] + (first_i + end_x) * size, spare, of_x)
            i = first_i + start_x
            start_x = end_x
            if side != BOTH_SIDES:
                output, total = _emit(of_x, in_x, size, side, face, output, total)
                continue
            if in_x < 3:
                continue
            first_j, last_j = _cell_range(of_x, in_x, y, origin, size)
            along_y = _layer_sides(known, face, y, i, x, first_j, last_j, of_x, in_x, spare, of_y)
            start_y = np.int64(0)
            while start_y < len(along_y):
                end_y, side = _run(along_y, start_y)
                low = origin[1] + (first_j + start_y) * size
                in_y = _clip_slab(of_x, in_x, y, low, origin[1] + (first_j + end_y) * size, spare, of_y)
                j = first_j + start_y
                start_y = end_y
                if side != BOTH_SIDES:
                    output, total = _emit(of_y, in_y, size, side, face, output, total)
                    continue
                if in_y < 3:
                    continue
                first_k, last_k = _cell_range(of_y, in_y, z, origin, size)
                along_z = _layer_sides(known, face, z, i, j, first_k, last_k, of_y, in_y, spare, of_z)
                start_z = np.int64(0)
                while start_z < len(along_z):
                    end_z, side = _run(along_z, start_z)
                    low = origin[2] + (first_k + start_z) * size
                    in_z = _clip_slab(of_y, in_y, z, low, origin[2] + (first_k + end_z) * size, spare, of_z)
                    start_z = end_z
                    output, total = _emit(of_z, in_z, size, side, face, output, total)
    return output.corners[:total], output.sides[:total], output.faces[:total]


def cut_triangles(
    corners: FloatArray,
    origin: FloatArray,
    size: float,
    cells: np.ndarray,
    faces: np.ndarray,
    inside: BoolArray,
    box: np.ndarray,
) -> tuple[FloatArray, BoolArray, IntArray]:
    """Cut triangles where inside cells meet other cells, and nowhere else.

    corners: float64 (f, 3, 3), each with a part on both sides
    cells, faces: int64 (m, 3) and int64 (m,), of the triangles' `fragments` in `box`
    inside: bool (m,), side of each fragment
    box: int64 (2, 3), lowest and highest cell; everything beyond is outside

    Returns triangles float64 (t, 3, 3), whether each is inside, and the triangle that it is part of, int32 (t,).
    """
    starts = np.searchsorted(faces, np.arange(len(corners) + 1))
    known = _Fragments(origin, size, cells, inside, starts, box)
    triangles, sides, owners = _all_cuts(np.ascontiguousarray(corners), known)
    return triangles, sides == SIDE_IN, owners.astype(np.int32)
