"""The local frame of a part by extremal points."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from stages.exemplars.extremal_frame import extremal_frame
from tests.stages.shape.geometry.bodies import box, hull, placed, prism, random_rotation, sphere


def is_pose(frame: np.ndarray) -> bool:
    rotation = frame[:3, :3]
    orthonormal = np.allclose(rotation.T @ rotation, np.eye(3), atol=1e-9) and np.linalg.det(rotation) > 0
    return bool(orthonormal and (frame[3] == [0, 0, 0, 1]).all())


@given(st.integers(0, 2**32 - 1))
def test_frame_of_a_part_moves_with_it(seed: int) -> None:
    rng = np.random.default_rng(seed)
    vertices = hull(rng)[0]
    centroid = vertices.mean(axis=0)
    pose = placed(*rng.uniform(-9, 9, 3), random_rotation(rng))
    turned = vertices[rng.permutation(len(vertices))] @ pose[:3, :3].T + pose[:3, 3]
    frame = extremal_frame(vertices, centroid)
    moved = extremal_frame(turned, pose[:3, :3] @ centroid + pose[:3, 3])
    assert is_pose(frame)
    np.testing.assert_allclose(moved, pose @ frame, atol=1e-6)


def test_axes_are_the_diagonal_and_the_direction_of_the_farthest_vertex() -> None:
    vertices = np.array([[0, 0, 0], [10, 0, 0], [3, 2, 0], [6, -1, 0.5]])
    frame = extremal_frame(vertices, np.array([4.0, 0.0, 0.0]))
    np.testing.assert_allclose(frame[:3, 0], [-1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(frame[:3, 1], [0, 1, 0], atol=1e-12)
    np.testing.assert_allclose(frame[:3, 2], [0, 0, -1], atol=1e-12)
    np.testing.assert_allclose(frame[:3, 3], [3, 0, 0], atol=1e-12)


def test_equally_far_corners_are_averaged() -> None:
    # A pyramid far out over a square: its tip, then the middle of the square.
    base = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0.0]])
    frame = extremal_frame(np.concatenate([base, [[0, 0, 9]]]), np.array([0, 0, 2.0]))
    np.testing.assert_allclose(frame[:3, 0], [0, 0, -1], atol=1e-12)


def test_symmetric_parts_have_a_frame_that_does_not_depend_on_the_order_of_corners() -> None:
    rng = np.random.default_rng(1)
    for vertices in (box()[0], box(1, 2, 3)[0], prism(6)[0], sphere(12, 6)[0]):
        frame = extremal_frame(vertices, np.zeros(3))
        assert is_pose(frame)
        for _ in range(5):
            np.testing.assert_allclose(extremal_frame(rng.permutation(vertices), np.zeros(3)), frame, atol=1e-9)


def test_flat_parts_have_a_frame() -> None:
    square = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0.0]])
    assert is_pose(extremal_frame(square, np.zeros(3)))
    assert is_pose(extremal_frame(square[:3], square[:3].mean(axis=0)))
