from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from stages.grammars.extraction.continuation import corner_cells, maps_enough_corners, separated_cells
from stages.grammars.extraction.docked_pieces import find_docked_pieces, surrounding_cells
from stages.grammars.extraction.grids import crossing_rows, find_one_grids
from stages.grammars.extraction.productions import seams_by_site
from stages.grammars.scans.scanned_grid import ScannedCloud, scanned_grid
from stages.symmetry.matching.candidate_transforms import candidate_transforms
from stages.symmetry.surface.grid import CELLS_PER_RADIUS, SurfaceGrid, surface_grid
from tests.stages.grammars.scanned import scanned
from tests.stages.symmetry.planted import area, box, shift, wall

RADIUS_SHARE = 0.03
UP = np.array([0.0, 0.0, 1.0])


def cut_at(grid: SurfaceGrid, across: float) -> np.ndarray:
    """Return the cells whose x is larger."""
    return np.flatnonzero(grid.origin[0] + grid.cell_size * (grid.cells[:, 0] + 0.5) > across).astype(np.int32)


def scan_grid(triangles: np.ndarray, share: float, points: int) -> SurfaceGrid:
    """Return the grid of a scan with noise of a fifth of a cell and eight holes."""
    cell = share / CELLS_PER_RADIUS * float(np.ptp(triangles.reshape(-1, 3), axis=0).max())
    at, _ = scanned(triangles, points, 0.2 * cell, 8, 1.5 * cell, np.random.default_rng(0))
    return scanned_grid(ScannedCloud(at, np.full((points, 3), 160, np.uint8)), share).grid


def has_ends(areas: list[float], period: float, count: int, ends: int) -> bool:
    """Return whether pieces of these areas are ends with 0 to `count` - 1 periods, `ends` of each length.

    Cells along the cuts may differ.
    """
    periods = (np.array(areas) - min(areas)) / period
    whole = np.round(periods)
    return bool((np.abs(periods - whole) < 0.15).all()) and Counter(whole.tolist()) == dict.fromkeys(range(count), ends)


class TestRows:
    @pytest.mark.parametrize(("windows", "storeys"), [(2, 1), (6, 1), (2, 2), (6, 2), (4, 3), (5, 3), (2, 5), (6, 5)])
    def test_wall_has_sites_and_grids_of_bays_and_storeys_only(self, windows: int, storeys: int) -> None:
        """Ends of the wall are one class, because it equals itself from behind; tops and feet are one class each.

        Grids are cut from the left or the right, and from above or below.
        """
        whole = area(wall(windows, storeys))
        grid = surface_grid(wall(windows, storeys), RADIUS_SHARE)
        pieces = find_docked_pieces(grid, candidate_transforms(grid, 24, UP))
        bay = (whole - area(wall(windows - 1, storeys))) / whole
        wanted = [(bay, windows, 2)]
        if storeys > 1:
            wanted += [((whole - area(wall(windows, storeys - 1))) / whole, storeys, 1)] * 2
        classes = [[piece.area for piece in pieces if piece.site == site] for site in {piece.site for piece in pieces}]
        assert len(classes) == len(wanted)
        for period, count, ends in wanted:
            exact = [has_ends(areas, period, count, ends) for areas in classes]
            assert any(exact)
            classes.pop(exact.index(True))
        seams = seams_by_site(grid, pieces)
        rows = find_one_grids(grid, pieces, seams)
        grids = [tuple(sorted(rows[index].count for index in chosen)) for chosen in crossing_rows(grid, pieces, rows)]
        counts = (windows - 1,) if storeys == 1 else tuple(sorted((windows - 1, storeys - 1)))
        assert grids == [counts] * 2 * len(counts)
        for row in rows:
            step = np.abs(row.transform - np.eye(4))
            assert np.allclose(step, np.abs(shift(1, 0, 0) - np.eye(4)), atol=1e-9) or np.allclose(
                step, np.abs(shift(0, 0, 2) - np.eye(4)), atol=1e-9
            )


class TestSites:
    def test_site_moved_by_a_bay_separates_one_bay_more(self) -> None:
        grid = surface_grid(wall(4), RADIUS_SHARE)
        cells = cut_at(grid, 2.6)
        after = separated_cells(grid, cells, surrounding_cells(grid, cells), shift(-1, 0, 0))
        assert after is not None
        differing = len(np.setxor1d(after, cut_at(grid, 1.6)))
        assert differing <= len(surrounding_cells(grid, cells)), "only cells along the cut may differ"

    def test_holes_of_a_scan_near_the_site_do_not_join_its_sides(self) -> None:
        grid = scan_grid(wall(3), 0.05, 40_000)
        cells = cut_at(grid, 2.6)
        after = separated_cells(grid, cells, surrounding_cells(grid, cells), shift(-1, 0, 0))
        assert after is not None
        assert len(np.setxor1d(after, cut_at(grid, 1.6))) <= len(surrounding_cells(grid, cells))

    def test_site_that_separates_nothing_at_its_new_position_has_no_piece(self) -> None:
        """A cut across a bar, moved to where the bar is a ring, which goes around the cut."""
        bar = box((-4.0, 0.0, 0.0), (-1.0, 0.2, 0.2))
        ring = [box((0, 0, 0), (3, 0.2, 0.2)), box((0, 0, 2), (3, 0.2, 2.2))]
        sides = [box((0, 0, 0.2), (0.2, 0.2, 2)), box((2.8, 0, 0.2), (3, 0.2, 2))]
        grid = surface_grid(np.concatenate([bar, *ring, *sides]), RADIUS_SHARE)
        x = grid.origin[0] + grid.cell_size * (grid.cells[:, 0] + 0.5)
        cells = np.flatnonzero((x > -2.5) & (x < -0.5)).astype(np.int32)
        border = surrounding_cells(grid, cells)
        assert separated_cells(grid, cells, border, shift(-0.5, 0, 0)) is not None
        assert separated_cells(grid, cells, border, shift(4, 0, 0)) is None

    def test_corners_are_where_no_translation_moves_the_surface_along_itself(self) -> None:
        grid = surface_grid(box((0, 0, 0), (1, 1, 1)), 0.2)
        middles = grid.origin + grid.cell_size * (grid.cells[corner_cells(grid)] + 0.5)
        assert len(middles) == 8
        assert (np.abs(middles - np.round(middles)) <= grid.cell_size / 2).all()

    def test_sheet_without_thickness_has_corners(self) -> None:
        sheet = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)[[[0, 1, 2], [0, 2, 3]]]
        assert len(corner_cells(surface_grid(sheet, 0.2))) == 4

    def test_translation_of_margins_onto_margins_maps_no_corners(self) -> None:
        grid = surface_grid(wall(3), RADIUS_SHARE)
        corners = corner_cells(grid)
        assert maps_enough_corners(grid, corners, shift(2, 0, 0))
        assert not maps_enough_corners(grid, corners, shift(3, 0, 0))

    def test_weak_items_of_a_scan_make_no_corners(self) -> None:
        grid = scan_grid(wall(4, 3), RADIUS_SHARE, 250_000)
        corners = corner_cells(grid)
        assert maps_enough_corners(grid, corners, shift(3, 0, 0))
        assert not maps_enough_corners(grid, corners, shift(4, 0, 0))
