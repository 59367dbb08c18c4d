"""What is r-similar to a wall or a stair is told from what is not, and where it differs."""

from __future__ import annotations

import numpy as np
import pytest

from eval.grammars.similarity import COLUMNS, Similarity, apart, r_similarity, similarity_row
from tests.stages.symmetry.planted import box, moved, screw, spiral_stair, wall

RADIUS = 0.16


def similarity(exemplar: np.ndarray, shape: np.ndarray, radius: float = RADIUS, probes: int = 500) -> Similarity:
    return r_similarity(exemplar, shape, radius, probes, np.random.default_rng(0))


def _largest(shape: np.ndarray) -> int:
    """The largest triangle."""
    return int(np.linalg.norm(np.cross(shape[:, 1] - shape[:, 0], shape[:, 2] - shape[:, 0]), axis=1).argmax())


def quartered(triangle: np.ndarray, times: int) -> np.ndarray:
    """A triangle (3, 3) as 4^times triangles of its shape."""
    if not times:
        return triangle[None]
    a, b, c = triangle
    ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
    return np.concatenate(
        [quartered(np.stack(each), times - 1) for each in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
    )


class TestSimilar:
    @pytest.mark.parametrize(("windows", "storeys"), [(1, 1), (6, 1), (2, 3)])
    def test_a_wall_of_other_windows_is_similar_to_one_that_has_all_its_kinds_of_corners(
        self, windows: int, storeys: int
    ) -> None:
        exemplar = wall(4) if storeys == 1 else wall(4, 3)
        assert similarity(exemplar, wall(windows, storeys)).share == 1.0

    def test_a_shape_may_stand_and_lie_anywhere(self) -> None:
        pose = screw(0.7, 3.0) @ np.diag([1.0, -1.0, -1.0, 1.0])
        assert similarity(wall(3), moved(wall(4), pose)).share == 1.0

    def test_a_stair_goes_on_by_its_screw(self) -> None:
        assert similarity(spiral_stair(4), spiral_stair(7)).share == 1.0

    def test_faces_may_be_cut_in_other_places_on_either_side_of_an_edge_and_leave_slivers(self) -> None:
        """As cuts along cells do: no two triangles share a side there, and normals of slivers are rounding."""
        shape = wall(2)
        flat = np.isclose(np.ptp(shape[..., 1], axis=1), 0)
        cut = np.concatenate([shape[~flat], *(quartered(each, 3) for each in shape[flat])])
        corners = np.unique(shape.reshape(-1, 3), axis=0)
        ways = np.random.default_rng(0).normal(size=(2, 6, len(corners), 3)) * 1e-9
        slivers = np.stack(np.broadcast_arrays(corners, corners + ways[0], corners + ways[1]), axis=-2).reshape(
            -1, 3, 3
        )
        found = similarity(wall(4), moved(np.concatenate([cut, slivers]), screw(0.7, 3.0)), probes=150)
        assert found.share == 1.0

    def test_motions_that_are_told_take_the_exemplar_to_the_shape(self) -> None:
        found = similarity(wall(4), moved(wall(4), screw(0.3, 1.0)))
        assert np.allclose(found.motions[:, :3, :3] @ found.motions[:, :3, :3].transpose(0, 2, 1), np.eye(3))
        assert len(found.motions) < 20


class TestNotSimilar:
    def test_a_hole_where_the_exemplar_has_none_is_found_where_it_is(self) -> None:
        shape = wall(6)
        largest = _largest(shape)
        found = similarity(wall(4), np.delete(shape, largest, 0), probes=2000)
        low, high = shape[largest].min(axis=0) - RADIUS, shape[largest].max(axis=0) + RADIUS
        assert found.share < 1.0
        assert ((found.worst > low) & (found.worst < high)).all()
        assert found.matched[((found.probes < low) | (found.probes > high)).any(axis=1)].all()

    def test_what_stands_on_a_wall_is_seen_where_it_meets_the_wall(self) -> None:
        found = similarity(wall(4), np.concatenate([wall(4), box((2.9, -0.1, 1.9), (3.2, 0.05, 2.1))]), probes=2000)
        assert found.share < 1.0
        assert np.abs(found.worst - (3.05, 0.0, 2.0)).max() < 0.15 + RADIUS

    def test_a_larger_radius_sees_that_a_window_is_taller(self) -> None:
        taller = wall(4)
        taller[..., 2][taller[..., 2] == 1.5] = 1.55
        assert similarity(wall(4), taller).share == 1.0  # no neighbourhood has both ends of a window
        assert similarity(wall(4), taller, radius=0.6, probes=200).share < 1.0

    def test_a_boundary_is_no_inner_point(self) -> None:
        """Symmetry §3.1, condition 2."""
        sheet = wall(3)[np.isclose(np.abs(np.ptp(wall(3)[..., 1], axis=1)), 0)]
        assert similarity(wall(3), sheet, probes=40).share < 1.0

    def test_a_surface_without_area_is_refused(self) -> None:
        with pytest.raises(ValueError, match="without area"):
            similarity(wall(3), np.zeros((2, 3, 3)))


class TestTable:
    def test_a_row_tells_what_is_similar_and_how_far_the_worst_is(self) -> None:
        exemplars = [wall(4), wall(4, 3)]
        longest = max(np.ptp(each.reshape(-1, 3), axis=0).max() for each in exemplars)
        holed = np.delete(wall(6), _largest(wall(6)), 0)
        row = similarity_row("walls", exemplars, [wall(6), holed], RADIUS / longest, 1500, np.random.default_rng(0))
        told = dict(zip(COLUMNS, row, strict=True))
        assert (told["exemplars"], told["shapes"], told["probes"]) == (2, 2, 3000)
        assert told["radius"] == pytest.approx(RADIUS)
        assert told["similar %"] == 50.0
        assert 50.0 < told["matched %"] < 100.0
        assert 0.0 < told["worst"] < 1.0

    def test_exemplars_side_by_side_do_not_touch(self) -> None:
        both = apart([wall(3), wall(3)])
        assert len(both) == 2 * len(wall(3))
        gap = both[len(wall(3)) :, :, 0].min() - both[: len(wall(3)), :, 0].max()
        assert gap == pytest.approx(np.ptp(wall(3)[..., 0]))
