from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from stages.exemplars.segmentation import pick_segmentation, segment_scene
from stages.symmetry.pieces import SurfacePiece, repeated_pieces
from stages.symmetry.surface.grid import surface_grid
from stages.symmetry.surface.soup import PlanePair, Soup, carve
from tests.stages.symmetry.planted import blocks, box, mesh, moved, one_object, screw, spiral_stair, wall


def copy_counts(triangles: np.ndarray) -> list[int]:
    return sorted(len(piece.poses) for piece in repeated_pieces(*mesh(triangles)))


@cache
def pieces_of_wall() -> list[SurfacePiece]:
    """The pieces of a wall of twelve windows: cells are a share of its length, so a long wall has fewer."""
    return repeated_pieces(*mesh(wall(12)))


class TestCarve:
    def test_both_sides_of_a_seam_are_the_whole_surface_with_one_border(self) -> None:
        corners = wall(3)
        grid = surface_grid(corners, 0.03)
        left = np.flatnonzero(grid.cells[:, 0] < np.median(grid.cells[:, 0])).astype(np.int32)
        pose = screw(0.3, 0.1)
        inside, outside = carve(Soup(grid.corners, grid.faces), grid, left, pose)
        assert inside.area + outside.area == pytest.approx(2 * (4.2 * 2.4 - 1.5) + 0.3 * (2 * 6.6 + 9), rel=1e-9)
        local = (inside.corners.mean(axis=1) - pose[:3, 3]) @ pose[:3, :3]
        cells = np.floor((local - grid.origin) / grid.cell_size)
        assert (cells[:, 0] < np.median(grid.cells[:, 0])).all()

    def test_triangles_that_stay_on_one_side_are_not_cut(self) -> None:
        corners = np.concatenate([box((0, 0, 0), (1, 1, 1)), box((5, 0, 0), (6, 1, 1))])
        grid = surface_grid(corners, 0.03)
        first = np.flatnonzero(grid.cells[:, 0] < np.median(grid.cells[:, 0])).astype(np.int32)
        inside, outside = carve(Soup(grid.corners, grid.faces), grid, first, np.eye(4))
        assert np.array_equal(inside.corners, corners[:12])
        assert np.array_equal(outside.corners, corners[12:])

    def test_slab_is_cut_by_planes_and_what_lies_outside_is_left_as_it_is(self) -> None:
        corners = wall(3)
        grid = surface_grid(corners, 0.03)
        half = np.flatnonzero(grid.cells[:, 0] < np.median(grid.cells[:, 0])).astype(np.int32)
        pose = screw(0.3, 0.1)
        surface = Soup(moved(grid.corners, pose), grid.faces)
        inside, outside = carve(surface, grid, half, pose, PlanePair(np.array([1.0, 0.0, 0.0]), 0.7, 0.8))
        local = moved(inside.corners, np.linalg.inv(pose))[..., 0]
        assert (local.min(), local.max()) == pytest.approx((0.7, 0.8))
        assert inside.area == pytest.approx(0.1 * 2 * (2.4 + 0.3))
        assert inside.area + outside.area == pytest.approx(surface.area)


class TestRepeatedPieces:
    def test_wall_is_two_ends_and_one_bay_per_window(self) -> None:
        pieces = pieces_of_wall()
        assert sorted(len(piece.poses) for piece in pieces) == [1, 1, 12]
        bays = next(piece for piece in pieces if len(piece.poses) == 12)
        assert np.allclose(np.sort([pose[0, 3] for pose in bays.poses]) - min(p[0, 3] for p in bays.poses), range(12))

    def test_a_row_is_cut_although_a_rail_runs_along_it_from_end_to_end(self) -> None:
        """No docking site separates the model, because the rail goes around it, as a crane's ladder does."""
        rail = blocks(
            [0.1, 0.2, 9.0, 9.1], [-0.5, -0.4, 0.0], [1.8, 1.9], lambda x, y, _: y < -0.4 or not 0.2 < x < 9.0
        )  # fmt: skip
        pieces = repeated_pieces(*mesh(np.concatenate([wall(8), rail])))
        assert max(len(piece.poses) for piece in pieces) >= 8
        bays = max(pieces, key=lambda piece: len(piece.poses))
        assert bays.triangles.area == pytest.approx(2 * (2.4 - 0.5) + 0.3 * (2 * 0.5 + 2 * 1.0) + 2 * 0.3, rel=0.15)

    def test_two_grids_that_cross_make_nine_pieces(self) -> None:
        """Symmetry figure 7a: the corners once, the borders in one direction, the middle in both."""
        assert copy_counts(wall(2, 3)) == [1, 1, 1, 1, 2, 2, 3, 3, 6]

    @pytest.mark.parametrize("turn", [0.0, 0.3])
    def test_grid_is_cut_in_both_directions_although_no_step_is_a_multiple_of_a_cell(self, turn: float) -> None:
        assert copy_counts(moved(wall(2, 6), screw(turn, 0.1))) == [1, 1, 1, 1, 2, 2, 6, 6, 12]

    @pytest.mark.slow
    def test_grid_that_leans_is_cut_in_both_directions(self) -> None:
        lean = np.eye(4)
        lean[np.ix_([0, 2], [0, 2])] = [[np.cos(0.3), np.sin(0.3)], [-np.sin(0.3), np.cos(0.3)]]
        niches = np.concatenate([wall(2, 5), box((0.1, 0.1, 0.1), (3.1, 0.2, 10.3))])
        assert copy_counts(moved(niches, screw(0.4, 0.0) @ lean)) == [1, 1, 1, 1, 2, 2, 5, 5, 10]

    def test_bays_of_a_grid_meet_at_planes_midway_between_the_windows(self) -> None:
        bays = max(pieces_of_wall(), key=lambda piece: len(piece.poses)).triangles.corners[..., 0]
        assert np.ptp(bays) == pytest.approx(1.0)
        assert bays.min() % 1 == pytest.approx(0.6, abs=0.06)

    @pytest.mark.slow
    def test_the_steps_of_a_spiral_stair_are_one_piece_under_a_screw(self) -> None:
        pieces = repeated_pieces(*mesh(spiral_stair(5, 0.8)))
        steps = [piece for piece in pieces if len(piece.poses) == 5]
        assert steps
        relative = np.linalg.inv(steps[0].poses[0]) @ steps[0].poses[1]
        assert min(np.abs(relative - screw(a, b)).max() for a, b in ((0.8, 0.35), (-0.8, -0.35))) < 1e-6

    def test_pieces_at_their_poses_are_the_surface(self) -> None:
        area = sum(len(piece.poses) * piece.triangles.area for piece in pieces_of_wall())
        assert area == pytest.approx(2 * (13.2 * 2.4 - 6.0) + 0.3 * (2 * 15.6 + 36), rel=1e-6)

    def test_surface_without_repetition_stays_whole(self) -> None:
        assert copy_counts(box((0, 0, 0), (6, 0.7, 0.5))) == [1]


class TestCutSurface:
    def test_mesh_in_one_piece_is_cut_by_its_repetitions(self) -> None:
        source, why, parts = pick_segmentation(one_object(wall(12)))
        assert source == "symmetry"
        assert parts.warnings == ()
        assert "14 pieces between copies of what repeats" in why
        assert len(parts.surfaces) == 3
        assert sorted(np.bincount([placement.surface for placement in parts.placements]).tolist()) == [1, 1, 12]

    @pytest.mark.parametrize(
        ("taper", "warning"),
        [
            (0.0, "1 triangles without area are left out"),
            (0.004, "what runs along a row was made equal at its copies; it differed by 13%"),
        ],
    )
    def test_uneven_strip_along_a_row_and_triangles_without_area_make_a_warning(
        self, taper: float, warning: str
    ) -> None:
        """The far end of a cable is thicker by less than a cell; along an even one lies a triangle without area."""
        cable = box((0.0, -0.031, 1.6), (6.2, -0.001, 1.7))
        cable[..., 2] += taper * cable[..., 0] * (cable[..., 2] > 1.65)
        flat = np.array([[[0, 0, 0], [1, 0, 0], [0.5, 0, 0]]], dtype=float)
        surface = [wall(5), cable] if taper else [wall(5), cable, flat]
        parts = segment_scene(one_object(np.concatenate(surface)), "symmetry")
        assert np.bincount([placement.surface for placement in parts.placements]).max() == 5
        assert parts.warnings == (warning,)

    def test_mesh_without_repetition_keeps_its_objects(self) -> None:
        source, why, _ = pick_segmentation(one_object(box((0, 0, 0), (6, 0.7, 0.5))))
        assert source == "objects"
        assert "nothing tells parts apart" in why

    def test_large_surface_in_a_small_box_is_not_searched_by_default(self) -> None:
        x, y, z = np.arange(20) / 19, np.array([0.0, 1.0]), np.arange(20) % 2
        fold = np.array([[[x[k], y[0], z[k]], [x[k + 1], y[0], z[k + 1]], [x[k], y[1], z[k]]] for k in range(19)])
        back = np.array(
            [[[x[k + 1], y[0], z[k + 1]], [x[k + 1], y[1], z[k + 1]], [x[k], y[1], z[k]]] for k in range(19)]
        )
        source, why, parts = pick_segmentation(one_object(np.concatenate([fold, back])))
        assert source == "objects"
        assert "too much surface to look unasked for what repeats" in why
        assert len(parts.placements) == 1

    def test_mesh_without_area_keeps_its_objects(self) -> None:
        flat = np.array([[[0, 0, 0], [1, 0, 0], [0.5, 0, 0]]], dtype=float)
        source, why, parts = pick_segmentation(one_object(flat))
        assert source == "objects"
        assert "nothing tells parts apart" in why
        assert len(parts.placements) == 1
