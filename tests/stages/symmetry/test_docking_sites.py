from __future__ import annotations

import itertools

import numpy as np
import pytest

from stages.symmetry.matching.candidate_transforms import candidate_transforms
from stages.symmetry.matching.docking_sites import DockingSite, count_slippable_motions, find_docking_sites
from stages.symmetry.matching.r_symmetry import (
    erode_cells,
    matched_items,
    mutually_symmetric_cells,
    r_symmetric_cells,
    symmetric_cells,
)
from stages.symmetry.surface.grid import SurfaceGrid, surface_grid
from tests.stages.symmetry.planted import (
    blocks,
    box,
    moved,
    prongs_and_bridge,
    screw,
    shift,
    spiral_stair,
    wall,
)

RADIUS_SHARE = 0.03


def sites_of(grid: SurfaceGrid, transform: np.ndarray) -> list[DockingSite]:
    return find_docking_sites(grid, transform, *r_symmetric_cells(grid, transform))


def has_transform(transforms: np.ndarray, wanted: np.ndarray) -> bool:
    both = np.concatenate([transforms, np.linalg.inv(transforms)])
    return bool(np.abs(both - wanted).max(axis=(1, 2)).min() < 1e-6)


@pytest.fixture(scope="module")
def four_windows() -> SurfaceGrid:
    return surface_grid(wall(4), RADIUS_SHARE)


class TestSurface:
    def test_boundary_lines_are_the_edges_of_the_solid_whatever_its_triangles(self) -> None:
        grid = surface_grid(blocks([0, 0.3, 1], [0, 0.6, 1], [0, 1], lambda *_: True), 0.2)
        lines = grid.points[grid.is_line]
        assert ((np.isclose(lines, 0) | np.isclose(lines, 1)).sum(axis=1) == 2).all()
        assert np.isclose(grid.area.sum(), 6.0)

    def test_slivers_and_duplicates_change_nothing(self) -> None:
        plain = box((0, 0, 0), (1, 1, 1))
        sliver = np.array([[[0, 0, 0], [1, 0, 0], [0.5, 0, 0]]], dtype=float)
        one, other = surface_grid(plain, 0.2), surface_grid(np.concatenate([plain, plain[:4], sliver]), 0.2)
        assert np.array_equal(one.keys, other.keys)
        assert np.array_equal(one.points, other.points)


class TestSymmetricCells:
    def test_partly_covered_sides_match_wherever_cells_cut_them(self) -> None:
        """Braces as thin sheets that run into rails, in one plane with the rails' faces."""
        rails = [box((0, y, 0), (8.1, y + 0.3, 0.3)) for y in (0.0, 1.7)]
        sheet = np.array([[0, -0.05, 0.3], [1.7, -0.05, 0.3], [1.7, 0.05, 0.3], [0, 0.05, 0.3]])[[[0, 1, 2], [0, 2, 3]]]
        braces = [moved(sheet, shift(k + 0.5, 0.15, 0) @ screw(1.2, 0)) for k in range(7)]
        grid = surface_grid(np.concatenate([*rails, *braces]), 0.0271)
        for count in range(1, 6):
            matched = matched_items(grid, shift(count, 0, 0))
            assert matched[(grid.points[:, 0] > 0.2) & (grid.points[:, 0] < 7.4 - count)].all()

    def test_wall_is_symmetric_except_one_period_before_its_end(self, four_windows: SurfaceGrid) -> None:
        forth, back = symmetric_cells(four_windows, shift(1, 0, 0))
        x = four_windows.origin[0] + four_windows.cell_size * (four_windows.cells[:, 0] + 0.5)
        slack = 1.01 * four_windows.cell_size
        # the left margin ends at 0.35, where a period later the first window ends; the last window begins at 3.85
        assert not forth[(x < slack) | (x > 4.2 + slack)].any()
        assert forth[(x > 0.35 + slack) & (x < 3.85 - slack)].all()
        assert not back[(x > 5.2 - slack) | (x < 1 - slack)].any()

    def test_erosion_keeps_cells_a_radius_away(self, four_windows: SurfaceGrid) -> None:
        symmetric = np.ones(len(four_windows), dtype=bool)
        symmetric[100] = False
        kept = erode_cells(four_windows, symmetric)
        away = np.linalg.norm(four_windows.cells - four_windows.cells[100], axis=1)
        assert not kept[away <= 3].any()
        assert kept[away > 4].all()

    def test_mutually_symmetric_cells_map_onto_mutual_cells(self, four_windows: SurfaceGrid) -> None:
        """A leak of the erosion on one side, as where two sheets are a cell apart, counts on both sides."""
        transform = shift(1, 0, 0)
        kept, kept_back = r_symmetric_cells(four_windows, transform)
        middles = four_windows.origin + four_windows.cell_size * (four_windows.cells + 0.5)
        target = middles[np.flatnonzero(kept_back & (np.abs(middles[:, 0] - 3) < 0.05))[0]]
        leak = np.linalg.norm(middles - target, axis=1) < 3.5 * four_windows.cell_size
        forth, back = mutually_symmetric_cells(four_windows, transform, kept, kept_back & ~leak)
        away = np.linalg.norm(middles + np.array([1, 0, 0]) - target, axis=1) / four_windows.cell_size
        assert leak.sum() > 10
        assert not forth[away < 2.5].any()
        assert (forth == mutually_symmetric_cells(four_windows, transform, kept, kept_back)[0])[away > 4.5].all()
        assert (back <= kept_back & ~leak).all()

    def test_turn_that_maps_a_box_onto_itself_has_no_site(self) -> None:
        grid = surface_grid(box((-1, -1, -1), (1, 1, 1)), 0.1)
        assert matched_items(grid, screw(np.pi / 2, 0.0)).all()
        assert sites_of(grid, screw(np.pi / 2, 0.0)) == []


class TestTransforms:
    def test_transforms_that_keep_an_axis_turn_nothing_over(self, four_windows: SurfaceGrid) -> None:
        up = np.array([0.0, 0.0, 1.0])
        anywhere, upright = (candidate_transforms(four_windows, 64, axis) for axis in (None, up))
        assert (anywhere[:, 2, 2] < 0).any(), "the wall equals itself upside down"
        assert len(upright)
        np.testing.assert_allclose(upright[:, :3, :3] @ up, np.tile(up, (len(upright), 1)), atol=1e-6)

    def test_the_period_of_a_wall_is_found(self, four_windows: SurfaceGrid) -> None:
        transforms = candidate_transforms(four_windows, 64)
        for count in (1, 2, 3):
            assert has_transform(transforms, shift(count, 0, 0))

    def test_the_screw_of_a_spiral_stair_is_found(self) -> None:
        assert has_transform(candidate_transforms(surface_grid(spiral_stair(6), RADIUS_SHARE), 32), screw(0.5, 0.35))

    def test_turned_wall_has_turned_transforms(self) -> None:
        turn = screw(0.7, 0.0)
        transforms = candidate_transforms(surface_grid(moved(wall(3), turn), RADIUS_SHARE), 64)
        assert has_transform(transforms, turn @ shift(1, 0, 0) @ np.linalg.inv(turn))


class TestDockingSites:
    @pytest.mark.parametrize("windows", [3, 4, 6])
    def test_wall_can_gain_and_lose_a_window(self, windows: int) -> None:
        grid = surface_grid(wall(windows), RADIUS_SHARE)
        sites = sites_of(grid, shift(1, 0, 0))
        assert [site.kind for site in sites] == ["delete", "insert"]
        delete, insert = sites
        for more, less in ((delete.secondary, delete.primary), (insert.primary, insert.secondary)):
            assert grid.area[np.setdiff1d(more, less)].sum() == pytest.approx(period_area(), rel=0.05)
        for site in sites:
            assert np.isin(site.border, np.r_[site.primary]).sum() == 0

    def test_pieces_of_one_transform_are_disjoint(self, four_windows: SurfaceGrid) -> None:
        sites = sites_of(four_windows, shift(1, 0, 0))
        for one, other in itertools.combinations(sites, 2):
            assert not np.intersect1d(one.primary, other.primary).size
            assert not np.intersect1d(one.secondary, other.secondary).size

    def test_pieces_whose_images_are_one_region_are_one_piece(self) -> None:
        """Symmetry figure 5: two prongs of one side map to a bridge of the other, which makes them one piece."""
        grid = surface_grid(prongs_and_bridge(), 0.02)
        sites = [site for site in sites_of(grid, shift(9, 0, 0)) if site.kind == "replace"]
        assert len(sites) == 1
        x = grid.origin[0] + grid.cell_size * grid.cells[sites[0].primary, 0]
        assert ((x < 2.5).any(), ((x > 2.5) & (x < 4.5)).any(), (x > 4.5).any()) == (True, False, True)

    def test_straight_prism_slips_one_way_and_plane_three(self) -> None:
        grid = surface_grid(box((0, 0, 0), (6, 1, 1)), 0.03)
        x, z = (grid.origin[d] + grid.cell_size * (grid.cells[:, d] + 0.5) for d in (0, 2))
        around = np.flatnonzero(np.abs(x - 3) < 0.3).astype(np.int32)
        top = around[z[around] > 1 - grid.cell_size]
        inner = top[np.abs(grid.cells[top, 1] - np.median(grid.cells[top, 1])) < 5]
        assert (count_slippable_motions(grid, around), count_slippable_motions(grid, inner)) == (1, 3)


def period_area() -> float:
    """Return the area of a bay of the wall: two sides without the hole, its own four sides, top and bottom."""
    return 2 * (1 * 2.4 - 0.5 * 1.0) + 0.3 * (2 * 0.5 + 2 * 1.0) + 2 * 0.3 * 1
