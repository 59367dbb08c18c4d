from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from stages.shape.geometry.pose import invert, pose_vectors, relative_poses, rigid_fit, rotation_angle, transform_points
from tests.stages.shape.geometry.bodies import placed, random_rotation

SEEDS = st.integers(0, 2**32 - 1)


def random_pose(rng: np.random.Generator, reach: float = 10.0) -> np.ndarray:
    return placed(*rng.uniform(-reach, reach, 3), random_rotation(rng))


@given(SEEDS)
def test_an_inverse_undoes_a_pose_and_stacks_of_poses(seed: int) -> None:
    rng = np.random.default_rng(seed)
    poses = np.array([random_pose(rng) for _ in range(3)])
    np.testing.assert_allclose(invert(poses) @ poses, np.tile(np.eye(4), (3, 1, 1)), atol=1e-12)
    np.testing.assert_allclose(invert(poses[0]), np.linalg.inv(poses[0]), atol=1e-12)


@given(SEEDS)
def test_a_relative_pose_leads_from_the_first_part_to_the_second(seed: int) -> None:
    rng = np.random.default_rng(seed)
    poses = np.array([random_pose(rng) for _ in range(4)])
    edges = np.array([[0, 1], [2, 3], [3, 0]])
    moved = relative_poses(poses, edges)
    for (i, j), pose in zip(edges.tolist(), moved, strict=True):
        np.testing.assert_allclose(poses[i] @ pose, poses[j], atol=1e-11)
    turned = random_pose(rng)
    np.testing.assert_allclose(relative_poses(turned @ poses, edges), moved, atol=1e-11)


@given(SEEDS, st.integers(3, 20))
def test_a_fit_recovers_a_motion_from_points_in_space(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    points, pose = rng.normal(size=(count, 3)), random_pose(rng)
    points[:, 2] *= count > 3
    np.testing.assert_allclose(rigid_fit(points, transform_points(pose, points)), pose, atol=1e-6)


@given(SEEDS, st.sampled_from(["plane", "line", "point"]))
def test_a_fit_of_flat_points_is_a_rotation_that_moves_them_where_they_belong(seed: int, shape: str) -> None:
    rng = np.random.default_rng(seed)
    kept = {"plane": 2, "line": 1, "point": 0}[shape]
    points = rng.normal(size=(6, 3)) * (np.arange(3) < kept) @ random_rotation(rng).T + rng.normal(size=3)
    pose = random_pose(rng)
    fitted = rigid_fit(points, transform_points(pose, points))
    np.testing.assert_allclose(transform_points(fitted, points), transform_points(pose, points), atol=1e-9)
    np.testing.assert_allclose(fitted[:3, :3] @ fitted[:3, :3].T, np.eye(3), atol=1e-9)
    assert np.linalg.det(fitted[:3, :3]) > 0


@given(SEEDS)
def test_a_fit_to_a_mirror_image_is_a_rotation_all_the_same(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(8, 3))
    fitted = rigid_fit(points, points * [1, 1, -1])
    np.testing.assert_allclose(fitted[:3, :3] @ fitted[:3, :3].T, np.eye(3), atol=1e-9)
    assert np.linalg.det(fitted[:3, :3]) > 0


@given(SEEDS)
def test_no_other_motion_fits_noisy_points_better(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(7, 3))
    target = transform_points(random_pose(rng), points) + rng.normal(size=(7, 3)) * 0.1
    fitted = rigid_fit(points, target)
    best = np.square(transform_points(fitted, points) - target).sum()
    for _ in range(5):
        nudge = placed(*rng.normal(size=3) * 0.02, np.eye(3))
        angle = rng.normal(size=3) * 0.02
        nudge[:3, :3] = rigid_fit(np.eye(3), np.eye(3) + np.cross(np.eye(3), angle))[:3, :3]
        assert np.square(transform_points(nudge @ fitted, points) - target).sum() >= best - 1e-9


def test_angles_of_rotations() -> None:
    quarter = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]])
    angles = rotation_angle(np.array([np.eye(4), placed(1, 2, 3, quarter), placed(rotation=quarter @ quarter)]))
    np.testing.assert_allclose(angles, [0, np.pi / 2, np.pi])


def test_distances_of_pose_vectors_are_displacements() -> None:
    small = 1e-3
    turn = np.array([[np.cos(small), -np.sin(small), 0], [np.sin(small), np.cos(small), 0], [0, 0, 1]])
    still, moved, turned = pose_vectors(np.array([np.eye(4), placed(0.3, 0, 0.4), placed(rotation=turn)]), length=5.0)
    assert np.isclose(np.linalg.norm(moved - still), 0.5)
    assert np.isclose(np.linalg.norm(turned - still), 5.0 * small * np.sqrt(2), rtol=1e-4)
