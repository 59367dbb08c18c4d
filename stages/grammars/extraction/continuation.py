"""What a docking site separates at a transformed position: rows go on farther than one transform shows
(symmetry §3.4.3)."""

from __future__ import annotations

import numpy as np

from stages.shape.arrays import FloatArray, IntArray
from stages.shape.geometry.pose import invert, transform_points
from stages.symmetry.matching.cell_lookup import is_among, items_in
from stages.symmetry.matching.docking_sites import connected_regions
from stages.symmetry.matching.r_symmetry import cells_within, matched_items
from stages.symmetry.surface.grid import SurfaceGrid

SIDE_BAND_CELLS = 3.0
"""Distance from a site, in cells, of the cells that tell its sides: all that is r-symmetric, apart from rounding."""
REACH_CELLS = 1.5
"""Cells are next to a moved site if their centres are closer, in cells, to cells next to the site."""
MIN_HELD_SHARE = 0.05
"""Smallest share of what fixes a corner in its best direction that must fix it in every other."""
MIN_CORNERS = 3
"""Corners that a transform must carry onto the surface, the votes that candidates need."""


def corner_cells(grid: SurfaceGrid) -> IntArray:
    """Return the cells whose surface no translation moves along itself, int32, ascending.

    A plane fixes the surface along its normal, a line across itself. Items that may be missing fix nothing.
    """
    held = grid.directions[:, :, None] * grid.directions[:, None, :]
    held[grid.is_line] = np.eye(3) - held[grid.is_line]
    if grid.weak is not None:
        held[grid.weak] = 0.0
    values = np.linalg.eigvalsh(np.add.reduceat(held, grid.starts[:-1], axis=0))
    return np.flatnonzero(values[:, 0] > MIN_HELD_SHARE * values[:, 2]).astype(np.int32)


def maps_enough_corners(grid: SurfaceGrid, corners: IntArray, transform: FloatArray) -> bool:
    """Return whether a rigid transform (4, 4) maps at least MIN_CORNERS of the `corner_cells` onto the surface."""
    items = items_in(grid, corners)
    lost = np.unique(grid.item_cell[items[~matched_items(grid, transform, items)]])
    return len(corners) - len(lost) >= MIN_CORNERS


def separated_cells(grid: SurfaceGrid, cells: IntArray, border: IntArray, transform: FloatArray) -> IntArray | None:
    """Return the cells that a docking site separates at a transformed position, int32, ascending, or None.

    cells, border: int32, of a docked piece and around it, ascending
    transform: float64 (4, 4), rigid; the surface around the border must be r-symmetric under it

    The two sides of the site are transformed. What is connected with the side of the piece is the new piece.
    """
    from scipy.spatial import KDTree

    band = cells_within(grid, border, SIDE_BAND_CELLS)
    inside = is_among(cells, band)
    back = (transform_points(invert(transform), grid.centres()) - grid.origin) / grid.cell_size - 0.5
    _, nearest = KDTree(grid.cells[band]).query(back, distance_upper_bound=REACH_CELLS)
    within, beyond = np.r_[inside, False][nearest], np.r_[~inside, False][nearest]
    separated = within.copy()
    for region in connected_regions(grid, ~(within | beyond)):
        around = grid.neighbours[region]
        around = around[around >= 0]
        if within[around].any():
            if beyond[around].any():
                return None
            separated[region] = True
    return np.flatnonzero(separated).astype(np.int32)
