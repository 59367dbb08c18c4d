"""Pieces cut out of the original triangles, so that all pieces that dock at equal sites have one seam (symmetry §4)."""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from stages.shape.arrays import BoolArray, FloatArray, IntArray
from stages.shape.geometry.pose import invert
from stages.symmetry.matching.cell_lookup import is_among, items_in, items_moved_into
from stages.symmetry.matching.r_symmetry import cells_within, matched_items
from stages.symmetry.surface.grid import SurfaceGrid
from stages.symmetry.surface.soup import Soup, carve, centres_in, join_soups

SEAM_BAND_CELLS = 3.0
"""Distance from a site, in cells, within which its seam is that of the class's first site.

Transformed sites of the class lie up to 2.5 cells from it.
"""
MIN_MATCHED_SHARE = 0.999
"""Share of planes and lines that must match, both ways, where a surface recurs; the others are rounding errors."""


@dataclass(frozen=True)
class Seam:
    """Where a class of sites is cut.

    band: int32, cells within SEAM_BAND_CELLS of its first site, ascending
    inner: int32, those of them in the docked piece
    """

    band: IntArray
    inner: IntArray


def make_seam(grid: SurfaceGrid, border: IntArray, cells: IntArray) -> Seam:
    """Return the seam between the cells of a docked piece and the `border` around it."""
    band = cells_within(grid, border, SEAM_BAND_CELLS)
    return Seam(band, band[is_among(cells, band)])


def cells_within_steps(grid: SurfaceGrid, cells: np.ndarray, steps: int) -> BoolArray:
    """Return which cells of the grid are at most `steps` neighbours from `cells`, bool (n,)."""
    chosen = np.zeros(len(grid), dtype=bool)
    chosen[cells] = True
    _grow(chosen, np.asarray(cells, dtype=np.int64), grid.neighbours, steps)
    return chosen


@numba.njit(cache=True)
def _grow(chosen, cells, neighbours, steps):
    """Set `chosen`, bool (n,), for the cells at most `steps` neighbours from `cells`."""
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
    """Return whether the surface at a pose (4, 4) is exactly that in ascending `cells`."""
    least = MIN_MATCHED_SHARE * grid.agreement
    if matched_items(grid, pose, items_in(grid, cells)).mean() < least:
        return False
    present = items_moved_into(grid, cells, pose)
    return bool(matched_items(grid, invert(pose), present).mean() >= least)


def cut_out(soup: Soup, grid: SurfaceGrid, cells: IntArray, frame: FloatArray, seam: Seam) -> tuple[Soup, Soup]:
    """Split a soup of the exemplar's triangles into a docked piece with these cells and the rest.

    frame: float64 (4, 4), from the first site of the class to the site of the piece

    Borders of cells do not move with a piece, and two pieces would not fit along them. So triangles near the site are
    cut along the transformed cells of the class's first site. Farther away nothing needs to be cut.
    """
    along, away = carve(soup, grid, seam.band, frame)
    inside, outside = carve(along, grid, seam.inner, frame)
    within = centres_in(away, grid, cells, np.eye(4))
    return join_soups(inside, away.select(within)), join_soups(outside, away.select(~within))
