"""Dockers cut out of the original triangles, so that all that dock at equal sites have one seam (symmetry §4)."""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from stages.shape.arrays import BoolArray, FloatArray, IntArray
from stages.shape.geometry.pose import invert
from stages.symmetry.matching.cell_lookup import is_among, items_in, items_moved_into
from stages.symmetry.matching.r_symmetry import cells_within, matched_items
from stages.symmetry.surface.grid import SurfaceGrid
from stages.symmetry.surface.soup import Soup, carve, join_soups, middles_in

BAND = 3.0
"""Cells around a site that are cut as the first of its class is: the others lie up to 2.5 cells from it once moved."""
STANDS = 0.999
"""Share of planes and lines that must lie where a motion takes them, both ways: all but what rounding makes."""


@dataclass(frozen=True)
class Seam:
    """Where a class of sites is cut: `band`, the cells within the radius of its first site, int32 ascending, and
    `inner`, those of them in the docker."""

    band: IntArray
    inner: IntArray


def make_seam(grid: SurfaceGrid, border: IntArray, cells: IntArray) -> Seam:
    """The seam between a docker's cells and the cells around it."""
    band = cells_within(grid, border, BAND)
    return Seam(band, band[is_among(cells, band)])


def cells_within_steps(grid: SurfaceGrid, cells: np.ndarray, steps: int) -> BoolArray:
    """Which cells of the grid are at most so many steps from `cells`, bool (n,)."""
    chosen = np.zeros(len(grid), dtype=bool)
    chosen[cells] = True
    _widen(chosen, np.asarray(cells, dtype=np.int64), grid.neighbours, steps)
    return chosen


@numba.njit(cache=True)
def _widen(chosen, cells, neighbours, steps):
    """Set the cells at most so many steps from `cells`."""
    queue = np.empty(len(chosen), dtype=np.int64)
    queue[: len(cells)] = cells
    begin, end = 0, len(cells)
    for _ in range(steps):
        tail = end
        for place in range(begin, end):
            for side in range(26):
                other = neighbours[queue[place], side]
                if other >= 0 and not chosen[other]:
                    chosen[other] = True
                    queue[tail] = other
                    tail += 1
        begin, end = end, tail


def surface_recurs(grid: SurfaceGrid, cells: IntArray, pose: FloatArray) -> bool:
    """Whether the surface has at a pose (4, 4) what lies in ascending cells, and nothing beside."""
    least = STANDS * grid.agreement
    if matched_items(grid, pose, items_in(grid, cells)).mean() < least:
        return False
    there = items_moved_into(grid, cells, pose)
    return bool(matched_items(grid, invert(pose), there).mean() >= least)


def cut_out(soup: Soup, grid: SurfaceGrid, cells: IntArray, frame: FloatArray, seam: Seam) -> tuple[Soup, Soup]:
    """What of a soup of the exemplar's triangles is of a docker with these cells, and what is not.

    Borders of cells do not move with a docker, and another would not fit where they meet. So along the site triangles
    are cut where the cells of the class's first site, moved here by `frame` (4, 4), part them; away from it nothing
    needs to be cut.
    """
    along, away = carve(soup, grid, seam.band, frame)
    inside, outside = carve(along, grid, seam.inner, frame)
    within = middles_in(away, grid, cells, np.eye(4))
    return join_soups(inside, away.select(within)), join_soups(outside, away.select(~within))
