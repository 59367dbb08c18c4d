"""Which cells of a surface are symmetric under a motion, and which r-symmetric (symmetry §3.1, §4.1)."""

from __future__ import annotations

import numba
import numpy as np

from stages.shape.arrays import BoolArray, FloatArray, IntArray
from stages.shape.geometry.pose import invert
from stages.symmetry.matching.cell_lookup import keys_at
from stages.symmetry.surface.grid import SurfaceGrid
from stages.symmetry.surface.lattice import cell_index, cell_of

TINY = 1e-9
HOLE = 50
"""Cells of a scan that may be missing in one place: about those within the radius of a point."""
ISOLATED = 16
"""Cells of a scan in one place that are taken for noise where they differ."""


def symmetric_cells(grid: SurfaceGrid, motion: FloatArray) -> tuple[BoolArray, BoolArray]:
    """The cells that a rigid motion (4, 4) maps onto the surface, and those that its inverse does, bool (n,) each.

    A cell is symmetric if each plane and each boundary line in it has its equal where the motion takes it, and nothing
    else lies there. Of a scan, where not all items need to agree, small regions that are not symmetric are taken for
    noise and holes.
    """
    back = invert(motion)
    lost, lost_back = (np.flatnonzero(~matched_items(grid, each)) for each in (motion, back))
    forth, backward = (_without(grid, lost, lost_back, back), _without(grid, lost_back, lost, motion))
    if grid.agreement == 1:
        return forth, backward
    differ = lost[_anything_at(grid, motion, lost)]
    differ_back = lost_back[_anything_at(grid, back, lost_back)]
    return (
        _without_specks(grid, forth, ~_without(grid, differ, differ_back, back)),
        _without_specks(grid, backward, ~_without(grid, differ_back, differ, motion)),
    )


def _without(grid: SurfaceGrid, lost: np.ndarray, lost_back: np.ndarray, back: FloatArray) -> BoolArray:
    """All cells but those of items `lost` under a motion, and those to which its inverse `back` (4, 4) takes items that
    are lost under it, bool (n,)."""
    found = np.ones(len(grid), dtype=bool)
    found[grid.item_cell[lost]] = False
    _mark(found, grid.points[lost_back], back, grid.origin, grid.cell_size, grid.keys, grid.tolerance)
    return found


def _anything_at(grid: SurfaceGrid, motion: FloatArray, items: np.ndarray) -> BoolArray:
    """Whether a motion takes each of some items to an occupied cell or beside one, bool (i,)."""
    found: BoolArray = _near_cells(grid.points[items], motion, grid.origin, grid.cell_size, grid.keys)
    return found


def _without_specks(grid: SurfaceGrid, symmetric: BoolArray, differs: BoolArray) -> BoolArray:
    """The symmetric cells, and regions of others that are small: at most HOLE cells, of which at most ISOLATED differ,
    while of the rest nothing is known. The paper removes isolated voxels of scans (symmetry §4.1)."""
    found: BoolArray = _filled(symmetric, differs, grid.neighbours, HOLE, ISOLATED)
    return found


def r_symmetric_cells(grid: SurfaceGrid, motion: FloatArray) -> tuple[BoolArray, BoolArray]:
    """The cells that are r-symmetric under a rigid motion (4, 4), and those that are under its inverse, bool (n,)."""
    forth, back = symmetric_cells(grid, motion)
    return erode_cells(grid, forth), erode_cells(grid, back)


def matched_items(grid: SurfaceGrid, motion: FloatArray, items: np.ndarray | None = None) -> BoolArray:
    """For each item of the grid (or of those with indices `items`) whether it is weak or, moved, lies on its equal."""
    asked = np.arange(len(grid.points)) if items is None else items
    found: BoolArray = _matched(
        asked, motion, grid.origin, grid.cell_size, grid.keys, grid.starts, grid.points, grid.directions, grid.is_line,
        grid.tolerance, grid.same_angle,
    )  # fmt: skip
    return found if grid.weak is None else found | grid.weak[asked]


def erode_cells(grid: SurfaceGrid, symmetric: BoolArray) -> BoolArray:
    """The r-symmetric cells: farther than the radius, along the surface, from every cell that is not symmetric."""
    return erode_cells_twice(grid, symmetric, 0.0)[0]


def erode_cells_twice(grid: SurfaceGrid, symmetric: BoolArray, beyond: float) -> tuple[BoolArray, BoolArray]:
    """The r-symmetric cells, and those that would be for a radius larger by so many cells `beyond`, bool (n,) each."""
    most = grid.radius / grid.cell_size
    away = _distances(symmetric, grid.cells, grid.neighbours, most + beyond)
    return away > most + TINY, away > most + beyond + TINY


def mutually_symmetric_cells(
    grid: SurfaceGrid, motion: FloatArray, kept: BoolArray, kept_back: BoolArray
) -> tuple[BoolArray, BoolArray]:
    """The cells of `kept` that a rigid motion (4, 4) takes to cells of `kept_back`, and those of `kept_back` that its
    inverse takes to cells of `kept`, bool (n,) each.

    What is r-symmetric under a motion is taken to what is r-symmetric under its inverse. But ways along cells are not:
    where two sheets are about a cell apart, erosion leaps from one to the other or does not, as the lattice falls.
    """
    return _taken_into(grid, motion, kept, kept_back), _taken_into(grid, invert(motion), kept_back, kept)


def _taken_into(grid: SurfaceGrid, motion: FloatArray, cells: BoolArray, into: BoolArray) -> BoolArray:
    """Which of `cells` have nothing that a motion takes to an occupied cell beside `into`."""
    keys = keys_at(grid, motion, grid.points)
    home = np.minimum(np.searchsorted(grid.keys, keys), len(grid) - 1)
    lost = (grid.keys[home] == keys) & ~into[home]
    found = cells.copy()
    found[grid.item_cell[lost]] = False
    return found


def cells_within(grid: SurfaceGrid, cells: IntArray, most: float) -> IntArray:
    """The cells that are at most so many cells, along the surface, from one of `cells`, int32 ascending."""
    apart = np.ones(len(grid), dtype=bool)
    apart[cells] = False
    near = _distances(apart, grid.cells, grid.neighbours, most) <= most + TINY
    return np.flatnonzero(near).astype(np.int32)


@numba.njit(cache=True)
def _matched(asked, motion, origin, size, keys, starts, points, directions, is_line, tolerance, same_angle):
    found = np.zeros(len(asked), dtype=np.bool_)
    at, along = np.empty(3), np.empty(3)
    low, high = np.empty(3, dtype=np.int64), np.empty(3, dtype=np.int64)
    for place in range(len(asked)):
        item = asked[place]
        for d in range(3):
            at[d] = motion[d, 3]
            along[d] = 0.0
            for e in range(3):
                at[d] += motion[d, e] * points[item, e]
                along[d] += motion[d, e] * directions[item, e]
        cell_of(at - tolerance, origin, size, low)
        cell_of(at + tolerance, origin, size, high)
        for i in range(low[0], high[0] + 1):
            for j in range(low[1], high[1] + 1):
                for k in range(low[2], high[2] + 1):
                    n = cell_index(keys, i, j, k)
                    if n < 0 or found[place]:
                        continue
                    for other in range(starts[n], starts[n + 1]):
                        if is_line[other] != is_line[item]:
                            continue
                        d0 = at[0] - points[other, 0]
                        d1 = at[1] - points[other, 1]
                        d2 = at[2] - points[other, 2]
                        u, v, w = directions[other, 0], directions[other, 1], directions[other, 2]
                        c0 = along[1] * w - along[2] * v
                        c1 = along[2] * u - along[0] * w
                        c2 = along[0] * v - along[1] * u
                        if c0 * c0 + c1 * c1 + c2 * c2 > same_angle**2:
                            continue
                        if is_line[item]:
                            c0, c1, c2 = d1 * w - d2 * v, d2 * u - d0 * w, d0 * v - d1 * u
                            if c0 * c0 + c1 * c1 + c2 * c2 < tolerance**2:
                                found[place] = True
                                break
                        elif (
                            along[0] * u + along[1] * v + along[2] * w > 0 and abs(d0 * u + d1 * v + d2 * w) < tolerance
                        ):
                            found[place] = True
                            break
    return found


@numba.njit(cache=True)
def _near_cells(points, motion, origin, size, keys):
    """Whether a motion takes each point (n, 3) to an occupied cell or beside one."""
    found = np.zeros(len(points), dtype=np.bool_)
    at, cell = np.empty(3), np.empty(3, dtype=np.int64)
    for place in range(len(points)):
        for d in range(3):
            at[d] = motion[d, 3]
            for e in range(3):
                at[d] += motion[d, e] * points[place, e]
        cell_of(at, origin, size, cell)
        for x in range(-1, 2):
            for y in range(-1, 2):
                for z in range(-1, 2):
                    if not found[place] and cell_index(keys, cell[0] + x, cell[1] + y, cell[2] + z) >= 0:
                        found[place] = True
    return found


@numba.njit(cache=True)
def _filled(symmetric, differs, neighbours, most, most_differ):
    """The symmetric cells with regions of at most so many others, at most so many of which differ."""
    found, seen = symmetric.copy(), symmetric.copy()
    region = np.empty(len(symmetric), dtype=np.int64)
    for first in range(len(symmetric)):
        if seen[first]:
            continue
        seen[first], region[0] = True, first
        head, tail, count = 0, 1, 0
        while head < tail:
            n = region[head]
            head += 1
            count += differs[n]
            for place in range(26):
                other = neighbours[n, place]
                if other >= 0 and not seen[other]:
                    seen[other] = True
                    region[tail] = other
                    tail += 1
        if tail <= most and count <= most_differ:
            found[region[:tail]] = True
    return found


@numba.njit(cache=True)
def _mark(symmetric, points, motion, origin, size, keys, tolerance):
    """Set the cells to which a motion takes points to False."""
    at, low, high = np.empty(3), np.empty(3, dtype=np.int64), np.empty(3, dtype=np.int64)
    for place in range(len(points)):
        for d in range(3):
            at[d] = motion[d, 3]
            for e in range(3):
                at[d] += motion[d, e] * points[place, e]
        cell_of(at - tolerance, origin, size, low)
        cell_of(at + tolerance, origin, size, high)
        for i in range(low[0], high[0] + 1):
            for j in range(low[1], high[1] + 1):
                for k in range(low[2], high[2] + 1):
                    n = cell_index(keys, i, j, k)
                    if n >= 0:
                        symmetric[n] = False


@numba.njit(cache=True)
def _distances(symmetric, cells, neighbours, most):
    """Way along occupied cells to the next cell that is not symmetric, in cells; infinite beyond `most`."""
    distance = np.full(len(cells), np.inf)
    queue = np.empty(len(cells) + 1, dtype=np.int64)
    waiting = np.zeros(len(cells), dtype=np.bool_)
    head, tail, room = 0, 0, len(queue)
    for n in range(len(cells)):
        if not symmetric[n]:
            distance[n], waiting[n] = 0.0, True
            queue[tail] = n
            tail += 1
    while head != tail:
        n = queue[head]
        head = (head + 1) % room
        waiting[n] = False
        for place in range(26):
            other = neighbours[n, place]
            if other < 0:
                continue
            squared = 0
            for d in range(3):
                squared += (cells[n, d] - cells[other, d]) ** 2
            way = distance[n] + np.sqrt(squared)
            if way <= most + TINY and way < distance[other] - TINY:
                distance[other] = way
                if not waiting[other]:
                    waiting[other] = True
                    queue[tail] = other
                    tail = (tail + 1) % room
    return distance
