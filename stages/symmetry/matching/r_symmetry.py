"""Cells of a surface that are symmetric or r-symmetric under a rigid transform (symmetry §3.1, §4.1)."""

from __future__ import annotations

import numba
import numpy as np

from stages.shape.arrays import BoolArray, FloatArray, IntArray
from stages.shape.geometry.pose import invert
from stages.symmetry.matching.cell_lookup import keys_at
from stages.symmetry.surface.grid import SurfaceGrid
from stages.symmetry.surface.lattice import cell_index, cell_key, cell_of, cells_around, first_not_below_near

ROUNDING_CELLS = 1e-9
MAX_HOLE_CELLS = 50
"""Cells of a scan that may be missing in one region: about those within the radius of a point."""
MAX_NOISE_CELLS = 16
"""Cells of a scan in one region that count as noise where they differ."""


def symmetric_cells(grid: SurfaceGrid, transform: FloatArray) -> tuple[BoolArray, BoolArray]:
    """Find the cells that a rigid transform (4, 4) maps onto the surface, and those that its inverse maps, bool (n,).

    A cell is symmetric if each plane and boundary line in it has its equal at its new position, and nothing else lies
    there. In a scan, where not all items need to agree, small regions that differ count as noise or holes.
    """
    back = invert(transform)
    lost, lost_back = (np.flatnonzero(~matched_items(grid, way)) for way in (transform, back))
    forth, backward = _without(grid, lost, lost_back, back), _without(grid, lost_back, lost, transform)
    if grid.agreement == 1:
        return forth, backward
    differ = lost[_lands_on_surface(grid, transform, lost)]
    differ_back = lost_back[_lands_on_surface(grid, back, lost_back)]
    return (
        _fill_specks(grid, forth, ~_without(grid, differ, differ_back, back)),
        _fill_specks(grid, backward, ~_without(grid, differ_back, differ, transform)),
    )


def _without(grid: SurfaceGrid, lost: np.ndarray, lost_back: np.ndarray, back: FloatArray) -> BoolArray:
    """Return all cells except those of unmatched items, bool (n,).

    lost: items without a match under a transform
    lost_back: items without a match under its inverse `back` (4, 4), which takes them to cells that are excluded too
    """
    cells = np.ones(len(grid), dtype=bool)
    cells[grid.item_cell[lost]] = False
    _clear_cells_at(cells, grid.points[lost_back], back, grid.items)
    return cells


def _lands_on_surface(grid: SurfaceGrid, transform: FloatArray, items: np.ndarray) -> BoolArray:
    """Return whether a transform takes each item to an occupied cell or a neighbour of one, bool (i,)."""
    lands: BoolArray = _near_cells(grid.points[items], transform, grid.items)
    return lands


def _fill_specks(grid: SurfaceGrid, symmetric: BoolArray, differs: BoolArray) -> BoolArray:
    """Add small regions to the symmetric cells: at most MAX_HOLE_CELLS cells, at most MAX_NOISE_CELLS of them differ.

    Nothing is known of the cells that do not differ. The paper removes isolated voxels of scans (symmetry §4.1).
    """
    filled: BoolArray = _filled(symmetric, differs, grid.neighbours, MAX_HOLE_CELLS, MAX_NOISE_CELLS)
    return filled


def r_symmetric_cells(grid: SurfaceGrid, transform: FloatArray) -> tuple[BoolArray, BoolArray]:
    """Find the cells that are r-symmetric under a rigid transform (4, 4), and those under its inverse, bool (n,)."""
    forth, back = symmetric_cells(grid, transform)
    return erode_cells(grid, forth), erode_cells(grid, back)


def matched_items(grid: SurfaceGrid, transform: FloatArray, items: np.ndarray | None = None) -> BoolArray:
    """Return whether each item is weak or lies on its equal once it is transformed, bool (i,).

    items: indices; all items of the grid if None
    """
    queried = np.arange(len(grid.points)) if items is None else items
    matched: BoolArray = _matched(queried, transform, grid.items)
    return matched if grid.weak is None else matched | grid.weak[queried]


def erode_cells(grid: SurfaceGrid, symmetric: BoolArray) -> BoolArray:
    """Return the r-symmetric cells: farther than the radius, along the surface, from every cell not symmetric."""
    return erode_cells_twice(grid, symmetric, 0.0)[0]


def erode_cells_twice(grid: SurfaceGrid, symmetric: BoolArray, beyond: float) -> tuple[BoolArray, BoolArray]:
    """Return the r-symmetric cells for the radius, and for a radius larger by `beyond` cells, bool (n,) each."""
    radius = grid.radius / grid.cell_size
    distance = _distances(symmetric, grid.cells, grid.neighbours, radius + beyond)
    return distance > radius + ROUNDING_CELLS, distance > radius + beyond + ROUNDING_CELLS


def mutually_symmetric_cells(
    grid: SurfaceGrid, transform: FloatArray, kept: BoolArray, kept_back: BoolArray
) -> tuple[BoolArray, BoolArray]:
    """Return the cells of `kept` that a rigid transform (4, 4) takes to cells of `kept_back`, and the reverse.

    What is r-symmetric under a transform is mapped to what is r-symmetric under its inverse. Distances along cells are
    not: where two sheets are about a cell apart, the lattice decides whether erosion leaps from one to the other.
    """
    return (
        _taken_into(grid, transform, kept, kept_back),
        _taken_into(grid, invert(transform), kept_back, kept),
    )


def _taken_into(grid: SurfaceGrid, transform: FloatArray, cells: BoolArray, into: BoolArray) -> BoolArray:
    """Return the `cells` whose items a transform never takes to an occupied cell outside `into`, bool (n,)."""
    keys = keys_at(grid, transform, grid.points)
    home = np.minimum(np.searchsorted(grid.keys, keys), len(grid) - 1)
    lost = (grid.keys[home] == keys) & ~into[home]
    taken = cells.copy()
    taken[grid.item_cell[lost]] = False
    return taken


def cells_within(grid: SurfaceGrid, cells: IntArray, max_distance: float) -> IntArray:
    """Return the cells at most `max_distance` cells, along the surface, from one of `cells`, int32, ascending."""
    outside = np.ones(len(grid), dtype=bool)
    outside[cells] = False
    near = _distances(outside, grid.cells, grid.neighbours, max_distance) <= max_distance + ROUNDING_CELLS
    return np.flatnonzero(near).astype(np.int32)


@numba.njit(cache=True)
def _matched(queried, transform, items):
    """Return whether each queried item, transformed, lies on an item of the same kind, bool (i,); `GridItems`."""
    origin, size, keys, starts, points, directions, is_line, tolerance, same_angle = items
    matched = np.zeros(len(queried), dtype=np.bool_)
    at, along = np.empty(3), np.empty(3)
    low, high = np.empty(3, dtype=np.int64), np.empty(3, dtype=np.int64)
    n = 0
    for place in range(len(queried)):
        item = queried[place]
        for d in range(3):
            at[d] = transform[d, 3]
            along[d] = 0.0
            for e in range(3):
                at[d] += transform[d, e] * points[item, e]
                along[d] += transform[d, e] * directions[item, e]
        cells_around(at, tolerance, origin, size, low, high)
        for i in range(low[0], high[0] + 1):
            for j in range(low[1], high[1] + 1):
                for k in range(low[2], high[2] + 1):
                    if matched[place]:
                        break
                    key = cell_key(i, j, k)
                    n = first_not_below_near(keys, key, n)  # neighbors mostly remain neighbors
                    if n == len(keys) or keys[n] != key:
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
                                matched[place] = True
                                break
                        elif (
                            along[0] * u + along[1] * v + along[2] * w > 0 and abs(d0 * u + d1 * v + d2 * w) < tolerance
                        ):
                            matched[place] = True
                            break
    return matched


@numba.njit(cache=True)
def _near_cells(points, transform, items):
    """Return whether a transform takes each point (n, 3) to an occupied cell or a neighbour of one, bool (n,)."""
    near = np.zeros(len(points), dtype=np.bool_)
    at, cell = np.empty(3), np.empty(3, dtype=np.int64)
    for place in range(len(points)):
        for d in range(3):
            at[d] = transform[d, 3]
            for e in range(3):
                at[d] += transform[d, e] * points[place, e]
        cell_of(at, items.origin, items.size, cell)
        for x in range(-1, 2):
            for y in range(-1, 2):
                for z in range(-1, 2):
                    if not near[place] and cell_index(items.keys, cell[0] + x, cell[1] + y, cell[2] + z) >= 0:
                        near[place] = True
    return near


@numba.njit(cache=True)
def _filled(symmetric, differs, neighbours, max_cells, max_differing):
    """Add regions of at most `max_cells` cells to the symmetric ones, if at most `max_differing` of them differ."""
    filled, seen = symmetric.copy(), symmetric.copy()
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
        if tail <= max_cells and count <= max_differing:
            filled[region[:tail]] = True
    return filled


@numba.njit(cache=True)
def _clear_cells_at(cells, points, transform, items):
    """Set `cells`, bool (n,), to False where a transform takes points."""
    at, low, high = np.empty(3), np.empty(3, dtype=np.int64), np.empty(3, dtype=np.int64)
    n, keys = 0, items.keys
    for place in range(len(points)):
        for d in range(3):
            at[d] = transform[d, 3]
            for e in range(3):
                at[d] += transform[d, e] * points[place, e]
        cells_around(at, items.tolerance, items.origin, items.size, low, high)
        for i in range(low[0], high[0] + 1):
            for j in range(low[1], high[1] + 1):
                for k in range(low[2], high[2] + 1):
                    key = cell_key(i, j, k)
                    n = first_not_below_near(keys, key, n)
                    if n < len(keys) and keys[n] == key:
                        cells[n] = False


@numba.njit(cache=True)
def _distances(symmetric, cells, neighbours, limit):
    """Return the distance along occupied cells to the next cell not symmetric, in cells; infinite beyond `limit`."""
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
            if way <= limit + ROUNDING_CELLS and way < distance[other] - ROUNDING_CELLS:
                distance[other] = way
                if not waiting[other]:
                    waiting[other] = True
                    queue[tail] = other
                    tail = (tail + 1) % room
    return distance
