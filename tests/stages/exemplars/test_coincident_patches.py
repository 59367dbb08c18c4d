"""Two-sided surfaces whose sides have other triangles are one surface after repair."""

from __future__ import annotations

import numpy as np
import pytest

from stages.exemplars.repair import repair_mesh
from tests.stages.exemplars.model_files import signed_volume

CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=np.float64)
QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
FRONT = np.array([face for a, b, c, d in QUADS for face in ((a, b, c), (a, c, d))], dtype=np.int32)
OTHER = np.array([face for a, b, c, d in QUADS for face in ((b, c, d), (b, d, a))], dtype=np.int32)
BOTH = np.concatenate([CORNERS, CORNERS])


@pytest.mark.parametrize(
    ("vertices", "faces"),
    [
        (CORNERS, np.concatenate([FRONT, OTHER[:, ::-1]])),
        (CORNERS, np.concatenate([FRONT, OTHER])),
        (BOTH, np.concatenate([FRONT, OTHER[:, ::-1] + 8])),
        (BOTH, np.concatenate([FRONT, OTHER + 8])),
        (CORNERS, np.stack([FRONT, OTHER[:, ::-1]], axis=1).reshape(-1, 3)),
        (CORNERS, np.concatenate([FRONT, FRONT[:, ::-1]])),
    ],
    ids=["reversed", "repeated", "reversed shell", "repeated shell", "by turns", "same triangles"],
)
def test_second_side_with_other_diagonals_is_removed(vertices: np.ndarray, faces: np.ndarray) -> None:
    points, kept, sources, repair = repair_mesh(vertices, faces)
    assert (len(kept), len(sources), repair.changes) == (12, 12, {"duplicate_faces": 12})
    assert signed_volume(points, kept) == pytest.approx(1)


def test_wall_that_two_boxes_share_stays_on_both() -> None:
    vertices = np.concatenate([CORNERS, CORNERS + np.array([1, 0, 0])])
    faces = np.concatenate([FRONT, OTHER + 8])
    points, kept, _, repair = repair_mesh(vertices, faces)
    assert (len(kept), repair.changes) == (24, {})
    assert signed_volume(points, kept) == pytest.approx(2)


def test_plate_of_two_sides_becomes_a_sheet() -> None:
    faces = np.array([[0, 1, 3], [0, 3, 2], [1, 0, 2], [1, 2, 3]], dtype=np.int32)
    _, kept, _, repair = repair_mesh(CORNERS[:4], faces)
    assert (len(kept), repair.changes) == (2, {"duplicate_faces": 2})
