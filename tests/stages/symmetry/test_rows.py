from __future__ import annotations

import numpy as np
import pytest

from stages.symmetry.rows import chunks_along, find_row
from stages.symmetry.surface.grid import surface_grid
from stages.symmetry.surface.soup import Soup, cut_by_plane
from tests.stages.symmetry.planted import box, screw


def soup(corners: np.ndarray) -> Soup:
    return Soup(corners, np.arange(len(corners), dtype=np.int32))


def translations(*along: float) -> list[np.ndarray]:
    poses = [np.eye(4) for _ in along]
    for pose, x in zip(poses, along, strict=True):
        pose[0, 3] = x
    return poses


class TestCutByPlane:
    def test_both_sides_of_a_box_keep_its_surface_and_their_faces(self) -> None:
        whole = soup(box((0, 0, 0), (4, 1, 1)))
        below, beyond = cut_by_plane(whole, np.array([1.0, 0, 0]), 1.5)
        assert below.area == pytest.approx(1 + 1.5 * 4)
        assert beyond.area == pytest.approx(1 + 2.5 * 4)
        assert below.corners[..., 0].max() == pytest.approx(1.5)
        assert beyond.corners[..., 0].min() == pytest.approx(1.5)
        normals = np.cross(below.corners[:, 1] - below.corners[:, 0], below.corners[:, 2] - below.corners[:, 0])
        faces = whole.corners[below.faces]
        old = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
        assert ((normals * old).sum(axis=1) > 0).all()


class TestRow:
    def test_copies_at_multiples_of_a_step_are_a_row_with_gaps(self) -> None:
        row = find_row(translations(0, 4, 2, -6), 1e-3)
        assert row is not None
        assert row.step == pytest.approx(2)
        assert sorted((row.multiples * round(float(row.direction[0]))).tolist()) == [-3, 0, 1, 2]

    def test_two_copies_turned_copies_and_uneven_copies_make_no_row(self) -> None:
        assert find_row(translations(0, 1), 1e-3) is None
        assert find_row([np.eye(4), screw(0.3, 1.0), screw(0.6, 2.0)], 1e-3) is None
        assert find_row(translations(0, 2, 3.1), 1e-3) is None


class TestChunks:
    def test_cable_is_cut_where_copies_meet_and_distant_beam_is_not(self) -> None:
        bay, beam = box((0, 0, 0), (2, 2, 2)), box((-1, 0, 9), (9, 1, 10))
        cable = box((-1, 2.05, 0.5), (9, 2.08, 0.6))
        rest = soup(np.concatenate([cable, beam]))
        grid = surface_grid(np.concatenate([bay, rest.corners]), 0.016)
        row = find_row(translations(0, 2, 4), grid.tolerance)
        assert row is not None
        chunks, left = chunks_along(soup(bay), row, rest, grid)
        around = 2 * (0.03 + 0.1)
        assert [chunk.area for chunk in chunks] == pytest.approx([2 * around] * 3)
        assert [chunk.corners[..., 0].min() for chunk in chunks] == pytest.approx([0, 2, 4])
        assert left.area == pytest.approx(4 * around + 2 * 0.003 + soup(beam).area)
