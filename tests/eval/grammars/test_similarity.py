"""r-similarity of walls and stairs, and where shapes differ."""

from __future__ import annotations

import numpy as np
import pytest

from eval.grammars.similarity import COLUMNS, Similarity, lay_side_by_side, r_similarity, similarity_row
from tests.stages.symmetry.planted import box, moved, screw, spiral_stair, wall

SIMILARITY_RADIUS = 0.16


def similarity(
    exemplar: np.ndarray, shape: np.ndarray, radius: float = SIMILARITY_RADIUS, probes: int = 500
) -> Similarity:
    return r_similarity(exemplar, shape, radius, probes, np.random.default_rng(0))


def _largest(shape: np.ndarray) -> int:
    """Return the index of the largest triangle."""
    return int(np.linalg.norm(np.cross(shape[:, 1] - shape[:, 0], shape[:, 2] - shape[:, 0]), axis=1).argmax())


def quartered(triangle: np.ndarray, times: int) -> np.ndarray:
    """Split a triangle (3, 3) into 4^times similar ones."""
    if not times:
        return triangle[None]
    a, b, c = triangle
    ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
    return np.concatenate(
        [quartered(np.stack(part), times - 1) for part in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
    )


class TestSimilar:
    @pytest.mark.parametrize(("windows", "storeys"), [(1, 1), (6, 1), (2, 3)])
    def test_wall_is_similar_to_one_with_all_its_kinds_of_corners(self, windows: int, storeys: int) -> None:
        exemplar = wall(4) if storeys == 1 else wall(4, 3)
        assert similarity(exemplar, wall(windows, storeys)).share == 1.0

    def test_similarity_does_not_depend_on_pose(self) -> None:
        pose = screw(0.7, 3.0) @ np.diag([1.0, -1.0, -1.0, 1.0])
        assert similarity(wall(3), moved(wall(4), pose)).share == 1.0

    def test_longer_spiral_stair_is_similar(self) -> None:
        assert similarity(spiral_stair(4), spiral_stair(7)).share == 1.0

    def test_similarity_ignores_tessellation_and_slivers(self) -> None:
        """As after cuts along cells: triangles do not share sides there, and normals of slivers are noise."""
        shape = wall(2)
        flat = np.isclose(np.ptp(shape[..., 1], axis=1), 0)
        cut = np.concatenate([shape[~flat], *(quartered(triangle, 3) for triangle in shape[flat])])
        corners = np.unique(shape.reshape(-1, 3), axis=0)
        offsets = np.random.default_rng(0).normal(size=(2, 6, len(corners), 3)) * 1e-9
        slivers = np.stack(np.broadcast_arrays(corners, corners + offsets[0], corners + offsets[1]), axis=-2).reshape(
            -1, 3, 3
        )
        found = similarity(wall(4), moved(np.concatenate([cut, slivers]), screw(0.7, 3.0)), probes=150)
        assert found.share == 1.0

    def test_transforms_are_rigid_and_few(self) -> None:
        found = similarity(wall(4), moved(wall(4), screw(0.3, 1.0)))
        assert np.allclose(found.transforms[:, :3, :3] @ found.transforms[:, :3, :3].transpose(0, 2, 1), np.eye(3))
        assert len(found.transforms) < 20


class TestNotSimilar:
    def test_new_hole_is_located(self) -> None:
        shape = wall(4)
        largest = _largest(shape)
        found = similarity(wall(3), np.delete(shape, largest, 0), probes=750)
        low, high = shape[largest].min(axis=0) - SIMILARITY_RADIUS, shape[largest].max(axis=0) + SIMILARITY_RADIUS
        assert found.share < 1.0
        assert ((found.worst > low) & (found.worst < high)).all()
        assert found.matched[((found.probes < low) | (found.probes > high)).any(axis=1)].all()

    def test_new_box_is_located_at_its_contact(self) -> None:
        found = similarity(wall(4), np.concatenate([wall(4), box((2.9, -0.1, 1.9), (3.2, 0.05, 2.1))]))
        assert found.share < 1.0
        assert np.abs(found.worst - (3.05, 0.0, 2.0)).max() < 0.15 + SIMILARITY_RADIUS

    def test_larger_radius_detects_taller_window(self) -> None:
        taller = wall(4)
        taller[..., 2][taller[..., 2] == 1.5] = 1.55
        assert similarity(wall(4), taller).share == 1.0  # no neighbourhood has both ends of a window
        assert similarity(wall(4), taller, radius=0.6, probes=200).share < 1.0

    def test_boundary_differs_from_inner_point(self) -> None:
        """Symmetry §3.1, condition 2."""
        sheet = wall(3)[np.isclose(np.abs(np.ptp(wall(3)[..., 1], axis=1)), 0)]
        assert similarity(wall(3), sheet, probes=10).share < 1.0

    def test_surface_without_area_is_rejected(self) -> None:
        with pytest.raises(ValueError, match="has no area"):
            similarity(wall(3), np.zeros((2, 3, 3)))


class TestTable:
    def test_row_has_shares_and_worst_probe(self) -> None:
        exemplars = [wall(3), wall(1, 2)]
        longest = max(np.ptp(exemplar.reshape(-1, 3), axis=0).max() for exemplar in exemplars)
        holed = np.delete(wall(4), _largest(wall(4)), 0)
        row = similarity_row(
            "walls", exemplars, [wall(4), holed], SIMILARITY_RADIUS / longest, 750, np.random.default_rng(0)
        )
        cells = dict(zip(COLUMNS, row, strict=True))
        assert (cells["exemplars"], cells["shapes"], cells["probes"]) == (2, 2, 1500)
        assert cells["radius"] == pytest.approx(SIMILARITY_RADIUS)
        assert cells["similar %"] == 50.0
        assert 50.0 < cells["matched %"] < 100.0
        assert 0.0 < cells["worst"] < 1.0

    def test_side_by_side_exemplars_do_not_touch(self) -> None:
        both = lay_side_by_side([wall(3), wall(3)])
        assert len(both) == 2 * len(wall(3))
        gap = both[len(wall(3)) :, :, 0].min() - both[: len(wall(3)), :, 0].max()
        assert gap == pytest.approx(np.ptp(wall(3)[..., 0]))
