"""What a docking site parts where a motion takes it: rows go on farther than one motion tells (symmetry §3.4.3)."""

from __future__ import annotations

import numpy as np

from stages.shape.arrays import FloatArray, IntArray
from stages.shape.geometry.pose import invert, transform_points
from stages.symmetry.matching.cell_lookup import is_among, items_in
from stages.symmetry.matching.docking_sites import connected_regions
from stages.symmetry.matching.r_symmetry import cells_within, matched_items
from stages.symmetry.surface.grid import SurfaceGrid

BAND = 3.0
"""Cells around a site that tell its sides apart: all that is r-symmetric around it, but for what rounding takes."""
REACH = 1.5
"""Cells are beside a site that was moved if their middles are so near to cells beside it; unit: cells."""
HELD = 0.05
"""Least share of what holds the surface of a corner in place, of the direction in which that is most, in any other."""
CORNERS = 3
"""Corners that a motion must carry onto the surface, as those by which candidates are found."""


def corner_cells(grid: SurfaceGrid) -> IntArray:
    """The cells whose surface no shift takes along itself, int32 ascending: a plane holds it along its normal, a line
    across itself. What may be missing holds nothing."""
    held = grid.directions[:, :, None] * grid.directions[:, None, :]
    held[grid.is_line] = np.eye(3) - held[grid.is_line]
    if grid.weak is not None:
        held[grid.weak] = 0.0
    values = np.linalg.eigvalsh(np.add.reduceat(held, grid.starts[:-1], axis=0))
    return np.flatnonzero(values[:, 0] > HELD * values[:, 2]).astype(np.int32)


def maps_enough_corners(grid: SurfaceGrid, corners: IntArray, motion: FloatArray) -> bool:
    """Whether a rigid motion (4, 4) carries as many of the `corner_cells` onto the surface as a candidate must."""
    items = items_in(grid, corners)
    lost = np.unique(grid.item_cell[items[~matched_items(grid, motion, items)]])
    return len(corners) - len(lost) >= CORNERS


def separated_cells(grid: SurfaceGrid, cells: IntArray, border: IntArray, motion: FloatArray) -> IntArray | None:
    """The cells that a docking site parts from the rest where a rigid motion (4, 4) takes it, int32 ascending; None
    where it parts nothing there.

    cells, border: of a docker and around it, int32 ascending; around the border the surface must be r-symmetric under
    the motion. The two sides of the site are moved; what hangs together with the side of the docker is the new one.
    """
    from scipy.spatial import KDTree

    band = cells_within(grid, border, BAND)
    inside = is_among(cells, band)
    middles = grid.origin + (grid.cells + 0.5) * grid.cell_size
    back = (transform_points(invert(motion), middles) - grid.origin) / grid.cell_size - 0.5
    _, nearest = KDTree(grid.cells[band]).query(back, distance_upper_bound=REACH)
    within, beyond = np.r_[inside, False][nearest], np.r_[~inside, False][nearest]
    docker = within.copy()
    for region in connected_regions(grid, ~(within | beyond)):
        around = grid.neighbours[region]
        around = around[around >= 0]
        if within[around].any():
            if beyond[around].any():
                return None
            docker[region] = True
    return np.flatnonzero(docker).astype(np.int32)
