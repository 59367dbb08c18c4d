from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from eval.grammars.similarity import r_similarity
from stages.grammars.derivation import START_SITE, Derivation, grid_poses
from stages.grammars.extraction.docked_pieces import DockedPiece, find_docked_pieces, surrounding_cells
from stages.grammars.extraction.grids import ExtractedGrid, crossing_rows, cut_grid, find_one_grids
from stages.grammars.extraction.productions import ExtractedProduction, extract_productions, seams_by_site
from stages.shape.geometry.pose import transform_points
from stages.symmetry.matching.candidate_transforms import candidate_transforms
from stages.symmetry.surface.grid import SurfaceGrid, surface_grid
from tests.stages.symmetry.planted import area, screw, spiral_stair, wall

RADIUS_SHARE = 0.03


class Planted:
    """A surface with its docked pieces and its first grid."""

    def __init__(self, triangles: np.ndarray) -> None:
        self.triangles = triangles
        self.grid: SurfaceGrid = surface_grid(triangles, RADIUS_SHARE)
        self.docked_pieces: list[DockedPiece] = find_docked_pieces(self.grid, candidate_transforms(self.grid, 40))
        self.seams = seams_by_site(self.grid, self.docked_pieces)
        self.rows = find_one_grids(self.grid, self.docked_pieces, self.seams)
        self.sets = crossing_rows(self.grid, self.docked_pieces, self.rows)
        self.first: ExtractedGrid = cut_grid(
            self.grid, self.docked_pieces, [self.rows[index] for index in self.sets[0]], self.seams
        )

    def resized(self, *counts: int) -> np.ndarray:
        """Return the triangles of the first grid with these numbers of cells in its rows."""
        return np.concatenate(
            [
                transform_points(pose, self.first.pieces[piece][1].corners.reshape(-1, 3)).reshape(-1, 3, 3)
                for piece, pose in grid_poses(
                    self.first.transforms, self.first.counts, [along for along, _ in self.first.pieces], counts
                )
            ]
        )

    def similar_share(self, triangles: np.ndarray) -> float:
        rng = np.random.default_rng(0)
        return r_similarity(self.triangles, triangles, self.grid.radius, 80, rng).share


@pytest.fixture(scope="module")
def row() -> Planted:
    return Planted(wall(4))


@pytest.fixture(scope="module")
def facade() -> Planted:
    return Planted(wall(4, 3))


@pytest.fixture(scope="module")
def productions(row: Planted) -> list[ExtractedProduction]:
    return extract_productions(row.grid, row.docked_pieces, row.seams, np.random.default_rng(0))[0]


class TestSites:
    def test_ends_of_a_wall_with_up_to_three_bays_dock_at_one_class_of_sites(self, row: Planted) -> None:
        """Symmetry §3.4.2: equal sites are identified across the model."""
        bay = 2 * (1 * 2.4 - 0.5) + 0.3 * 3 + 0.6
        classes = [[piece.area for piece in row.docked_pieces if piece.site == site] for site in range(9)]
        areas = max(classes, key=lambda areas: max(areas, default=0.0))
        end = min(areas)
        windows = (np.array(sorted(areas)) - end) * area(row.triangles) / bay
        assert np.allclose(windows, np.round(windows), atol=0.1)
        assert set(np.round(windows)) == {0, 1, 2, 3}


class TestGrids:
    def test_wall_of_four_windows_is_a_row_of_three_cells_and_its_ends(self, row: Planted) -> None:
        assert [known.count for known in row.rows] == [3, 3]  # cut from the left and from the right
        assert np.allclose(np.abs(row.first.transforms[0, :3, 3]), (1, 0, 0), atol=1e-9)
        assert [along for along, _ in row.first.pieces] == [(0,), (1,), (2,)]

    @pytest.mark.parametrize("count", [0, 3, 7])
    def test_row_of_any_count_is_the_wall_with_one_window_more(self, row: Planted, count: int) -> None:
        shape = row.resized(count)
        assert area(shape) == pytest.approx(area(wall(count + 1)), rel=1e-9)
        assert row.similar_share(shape) == 1.0

    def test_two_rows_that_cross_are_a_grid_of_nine_pieces(self, facade: Planted) -> None:
        """Symmetry figure 7a."""
        assert sorted(facade.first.counts) == [2, 3]
        assert len(facade.first.pieces) == 9
        one, other = facade.first.transforms
        assert np.allclose(one @ other, other @ one)

    def test_rows_whose_sites_cross_differently_from_cell_to_cell_make_no_grid(self, facade: Planted) -> None:
        """Symmetry figure 7b: both rows have symmetric sites, but those of one lie higher in one cell of the other."""
        grid, one, other = facade.grid, *(facade.rows[index] for index in facade.sets[0])
        upward, along = (one, other) if abs(one.transform[2, 3]) > 1 else (other, one)
        middles = grid.origin + grid.cell_size * (grid.cells + 0.5)
        above = middles[:, 2] if upward.transform[2, 3] > 0 else 6.4 - 0.4 - middles[:, 2]

        def cut_at(heights: np.ndarray) -> list[DockedPiece]:
            """Return the pieces; those of the upward row are cut at heights (n,) of the cells, plus 2 per storey."""
            pieces = list(facade.docked_pieces)
            for number, index in enumerate(upward.docked_pieces):
                cells = np.flatnonzero(above > heights + 2 * number).astype(np.int32)
                pieces[index] = replace(pieces[index], cells=cells, border=surrounding_cells(grid, cells))
            return pieces

        in_one_bay = (middles[:, 0] > 1.6) & (middles[:, 0] < 2.6)
        assert crossing_rows(grid, cut_at(np.full(len(grid), 0.4)), [along, upward]) == [(0, 1)]
        assert crossing_rows(grid, cut_at(np.where(in_one_bay, 0.1, 0.4)), [along, upward]) == [(0,), (1,)]

    def test_grid_of_any_counts_is_the_larger_wall(self, facade: Planted) -> None:
        across = facade.first.counts.index(3)
        counts = (4, 3) if across == 0 else (3, 4)
        shape = facade.resized(*counts)
        assert area(shape) == pytest.approx(area(wall(5, 4)), rel=1e-9)
        assert facade.similar_share(shape) == 1.0

    def test_spiral_stair_continues_by_its_screw_motion(self) -> None:
        stair = Planted(spiral_stair(5))
        own = stair.rows[0].count
        assert own >= 2
        step = screw(0.5, 0.35) if stair.rows[0].transform[2, 3] > 0 else np.linalg.inv(screw(0.5, 0.35))
        assert np.allclose(stair.rows[0].transform, step, atol=1e-6)
        longer = stair.resized(own + 2)
        assert area(longer) == pytest.approx(area(stair.triangles) * 7 / 5, rel=1e-9)
        assert stair.similar_share(longer) == 1.0


class TestProductions:
    def test_original_derivations_have_the_area_of_the_exemplar(
        self, row: Planted, productions: list[ExtractedProduction]
    ) -> None:
        def whole(derivation: Derivation) -> float:
            return productions[derivation.production].terminal.area + sum(map(whole, derivation.parts))

        starts = [production for production in productions if production.site == START_SITE]
        assert starts
        for production in starts:
            parts = sum(whole(known.original) for known in production.non_terminals)
            assert production.terminal.area + parts == pytest.approx(area(row.triangles), rel=1e-9)

    def test_bay_is_followed_by_its_own_site(self, productions: list[ExtractedProduction]) -> None:
        """The production of a 1-grid leaves a site of its own class."""
        recursive = [known for known in productions if [left.site for left in known.non_terminals] == [known.site]]
        assert min(known.terminal.area for known in recursive) == pytest.approx(
            2 * (1 * 2.4 - 0.5) + 0.3 * 3 + 0.6, rel=1e-9
        )
        assert any(known.site == recursive[0].site and not known.non_terminals for known in productions)
