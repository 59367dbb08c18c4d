"""The original triangles, cut along the borders of cells (symmetry §4)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numba
import numpy as np

from stages.shape.arrays import BoolArray, FloatArray, IntArray
from stages.shape.geometry.components import connected_components
from stages.shape.geometry.pose import invert, transform_points
from stages.shape.geometry.triangles import triangle_areas
from stages.symmetry.matching.cell_lookup import is_among
from stages.symmetry.surface.clip import cut_triangles, fragments
from stages.symmetry.surface.grid import SurfaceGrid
from stages.symmetry.surface.lattice import cell_index, cell_keys, cell_of

BLOCK = 4
"""Triangles are looked at that come near blocks of so many cells along each axis in which there is something to cut."""
NEAR = 1e-3
"""How near to a block, as a share of its width."""


@dataclass(frozen=True)
class Soup:
    """Triangles of a mesh or pieces of them: corners float64 (t, 3, 3), and of which face each is, int32 (t,)."""

    corners: FloatArray
    faces: IntArray

    def __len__(self) -> int:
        return len(self.faces)

    def select(self, chosen: np.ndarray) -> Soup:
        """The triangles that are `chosen`, bool (t,) or indices."""
        return Soup(self.corners[chosen], self.faces[chosen])

    @cached_property
    def areas(self) -> FloatArray:
        """Area of each triangle, float64 (t,)."""
        return triangle_areas(self.corners)

    @cached_property
    def area(self) -> float:
        """Area of all triangles."""
        return float(self.areas.sum())


def carve(soup: Soup, grid: SurfaceGrid, cells: IntArray, pose: FloatArray) -> tuple[Soup, Soup]:
    """What of `soup` lies in the cells of `grid` with places `cells`, moved by `pose` (4, 4), and what does not.

    Triangles are cut where they leave the cells, and nowhere else, so that both sides of a seam have one border; splats
    are not cut, and are where their middles are.
    """
    if grid.splats:
        inside = middles_in(soup, grid, cells, pose)
        return soup.select(inside), soup.select(~inside)
    chosen = grid.cells[cells]
    box = np.array([chosen.min(axis=0), chosen.max(axis=0)])
    bounds = grid.origin + grid.cell_size * np.array([box[0], box[1] + 1])
    blocks = np.zeros((box[1] - box[0]) // BLOCK + 1, dtype=bool)
    blocks[tuple(((chosen - box[0]) // BLOCK).T)] = True
    back = invert(pose)
    asked = _reaching(soup.corners, back, bounds[0], BLOCK * grid.cell_size, blocks)
    if not len(asked):
        return soup.select(asked), soup
    local = transform_points(back, soup.corners[asked].reshape(-1, 3)).reshape(-1, 3, 3)
    where, owner, _ = fragments(local, grid.origin, grid.cell_size, box)
    inside = is_among(grid.keys[cells], cell_keys(where))
    held, total = np.bincount(owner[inside], minlength=len(asked)), np.bincount(owner, minlength=len(asked))
    whole = (held == total) & ((local >= bounds[0]) & (local <= bounds[1])).all(axis=(1, 2)) & (held > 0)
    crossing = (held > 0) & ~whole
    within = np.zeros(len(soup), dtype=bool)
    within[asked[whole]] = True
    cut = asked[crossing]
    mine = crossing[owner]
    corners, side, of = cut_triangles(
        local[crossing],
        grid.origin,
        grid.cell_size,
        where[mine],
        np.searchsorted(np.flatnonzero(crossing), owner[mine]),
        inside[mine],
        box,
    )
    corners = transform_points(pose, corners.reshape(-1, 3)).reshape(-1, 3, 3)
    untouched = ~within
    untouched[cut] = False
    pieces = Soup(corners, soup.faces[cut][of])
    return join_soups(soup.select(within), pieces.select(side)), join_soups(
        soup.select(untouched), pieces.select(~side)
    )


@numba.njit(cache=True)
def _reaching(corners, pose, low, size, blocks):
    """The places of triangles (f, 3, 3) whose boxes, moved by `pose` (4, 4), come near one of `blocks`, bool (i, j, k),
    `size` wide each from `low` (3,) on."""
    found, total = np.empty(len(corners), dtype=np.int64), 0
    first, last = np.empty(3, dtype=np.int64), np.empty(3, dtype=np.int64)
    for face in range(len(corners)):
        for d in range(3):
            least, most = np.inf, -np.inf
            for k in range(3):
                at = pose[d, 3]
                for e in range(3):
                    at += pose[d, e] * corners[face, k, e]
                least, most = min(least, at), max(most, at)
            # blocks that a triangle only touches count too: rounding must not decide
            first[d] = max(int(np.floor((least - low[d]) / size - NEAR)), 0)
            last[d] = min(int(np.floor((most - low[d]) / size + NEAR)), blocks.shape[d] - 1)
        if _any(blocks, first, last):
            found[total] = face
            total += 1
    return found[:total].copy()


@numba.njit(cache=True)
def _any(blocks, first, last):
    """Whether there is one of `blocks`, bool (i, j, k), from `first` to `last`."""
    for i in range(first[0], last[0] + 1):
        for j in range(first[1], last[1] + 1):
            for k in range(first[2], last[2] + 1):
                if blocks[i, j, k]:
                    return True
    return False


def middles_in(soup: Soup, grid: SurfaceGrid, cells: IntArray, pose: FloatArray) -> BoolArray:
    """Of which triangles of a soup the middle lies in ascending cells with places `cells`, moved by `pose` (4, 4), bool
    (t,)."""
    chosen = grid.cells[cells]
    low, high = (chosen.min(axis=0), chosen.max(axis=0)) if len(chosen) else (np.zeros(3, int), np.full(3, -1))
    found: BoolArray = _middles_in(soup.corners, invert(pose), grid.origin, grid.cell_size, grid.keys[cells], low, high)
    return found


@numba.njit(cache=True)
def _middles_in(corners, pose, origin, size, keys, low, high):
    """Of which triangles (f, 3, 3) the middle, moved by `pose` (4, 4), is in a cell from `low` to `high` (3,) with one
    of these keys, bool (f,)."""
    found = np.zeros(len(corners), dtype=np.bool_)
    at, cell = np.empty(3), np.empty(3, dtype=np.int64)
    for face in range(len(corners)):
        for d in range(3):
            at[d] = pose[d, 3]
            for e in range(3):
                at[d] += pose[d, e] * (corners[face, 0, e] + corners[face, 1, e] + corners[face, 2, e]) / 3
        cell_of(at, origin, size, cell)
        near = True
        for d in range(3):
            near &= low[d] <= cell[d] <= high[d]
        if near:
            found[face] = cell_index(keys, cell[0], cell[1], cell[2]) >= 0
    return found


def connected_soups(soup: Soup, origin: FloatArray, size: float) -> list[Soup]:
    """The pieces of a soup that occupy no neighbouring cells of the lattice with a corner at `origin` (3,) and cells of
    `size`, in the order of their first triangles."""
    from scipy.spatial import KDTree

    if not len(soup):
        return []
    where, owner, _ = fragments(soup.corners, origin, size)
    cells, place = np.unique(where, axis=0, return_inverse=True)
    beside = KDTree(cells).query_pairs(1.8, output_type="ndarray")
    component = connected_components(len(cells), beside)
    piece = np.full(len(soup), -1)
    piece[owner] = component[place.reshape(-1)]
    order = list(dict.fromkeys(piece[piece >= 0].tolist()))
    return [soup.select(piece == each) for each in order]


def join_soups(*soups: Soup) -> Soup:
    """The triangles of some soups, one after another."""
    return Soup(np.concatenate([each.corners for each in soups]), np.concatenate([each.faces for each in soups]))
