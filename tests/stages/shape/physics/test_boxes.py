"""Boxes in closed form against FCL, half-space intersection and hand-made cases."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stages.shape.arrays import FloatArray
from stages.shape.physics.boxes import (
    box_contacts,
    box_corners,
    boxes_within,
    overlap_volumes,
    recognise_boxes,
    separations,
)
from tests.stages.shape.geometry.bodies import box, fcl_gap, placed, random_rotation

PAIR = np.array([[0, 1]], dtype=np.int32)
Boxes = tuple[FloatArray, FloatArray, FloatArray]


def two_boxes(seed: int, near: float = 1.2) -> Boxes:
    rng = np.random.default_rng(seed)
    axes = np.stack([random_rotation(rng), random_rotation(rng)])
    return rng.uniform(-near, near, (2, 3)), axes, rng.uniform(0.1, 1.0, (2, 3))


def bodies(boxes: Boxes) -> list[tuple[FloatArray, np.ndarray]]:
    faces = box()[1]
    return [(corners, faces) for corners in box_corners(*boxes)]


@given(st.integers(0, 10**6), st.permutations(range(8)))
def test_corners_in_any_order_are_recognised_as_their_box(seed: int, order: list[int]) -> None:
    centres, axes, halves = two_boxes(seed)
    corners = box_corners(centres, axes, halves)[:, order]
    found, seen_centres, seen_axes, seen_halves = recognise_boxes(corners)
    assert found.all()
    again = box_corners(seen_centres, seen_axes, seen_halves)
    for one, other in zip(corners, again, strict=True):
        assert np.abs(one[:, None] - other[None]).sum(axis=2).min(axis=1).max() < 1e-9
    np.testing.assert_allclose(np.sort(seen_halves), np.sort(halves))


def test_eight_points_that_are_no_box_are_not_taken_for_one() -> None:
    corners = box_corners(np.zeros((4, 3)), np.tile(np.eye(3), (4, 1, 1)), np.tile([1.0, 2.0, 3.0], (4, 1)))
    corners[0, 3] += 0.01
    corners[1, :, 0] += 0.1 * corners[1, :, 1]  # sheared
    corners[2, 0] = corners[2, 1]
    assert recognise_boxes(corners)[0].tolist() == [False, False, False, True]


@given(st.integers(0, 10**6))
def test_distance_of_boxes_is_that_of_fcl(seed: int) -> None:
    boxes = two_boxes(seed)
    first, second = bodies(boxes)
    gap = fcl_gap(first, second, placed())
    if gap > 1e-6:
        assert boxes_within(*boxes, PAIR, gap * (1 + 1e-6))[0]
        assert not boxes_within(*boxes, PAIR, gap * (1 - 1e-6))[0]
    else:
        assert boxes_within(*boxes, PAIR, 0.0)[0]


@given(st.integers(0, 10**6))
def test_moved_by_their_depth_boxes_only_touch(seed: int) -> None:
    boxes = two_boxes(seed, near=0.3)
    depth = -separations(*boxes, PAIR)[0]
    if depth <= 1e-3:
        return
    rng = np.random.default_rng(seed)
    for way in rng.normal(size=(20, 3)):
        moved = boxes[0].copy()
        moved[0] += 0.98 * depth * way / np.linalg.norm(way)
        assert boxes_within(moved, boxes[1], boxes[2], PAIR, 0.0)[0], "no shorter way frees them"


@given(st.integers(0, 10**6))
def test_volume_shared_by_boxes_is_that_of_their_half_spaces(seed: int) -> None:
    from scipy.optimize import linprog
    from scipy.spatial import ConvexHull, HalfspaceIntersection

    centres, axes, halves = boxes = two_boxes(seed, near=0.5)
    normals = np.concatenate([axes[0], -axes[0], axes[1], -axes[1]])
    offsets = np.concatenate([sign * axes[k] @ centres[k] + halves[k] for k in range(2) for sign in (1, -1)])
    inside = linprog([0, 0, 0, -1], np.column_stack([normals, np.ones(12)]), offsets, bounds=[(None, None)] * 4)
    volume = overlap_volumes(*boxes, PAIR)[0]
    if inside.x[3] < 1e-3:
        assert volume < 0.01
        return
    corners = HalfspaceIntersection(np.column_stack([normals, -offsets]), inside.x[:3]).intersections
    assert volume == pytest.approx(ConvexHull(corners).volume, rel=1e-6)


def test_flush_boxes_share_the_volume_of_their_overlap_once() -> None:
    centres = np.array([[0.0, 0, 0], [0.5, 0, 0], [0, 0, 0]])
    boxes = centres, np.tile(np.eye(3), (3, 1, 1)), np.full((3, 3), 0.5)
    pairs = np.array([[0, 1], [0, 2]], dtype=np.int32)
    np.testing.assert_allclose(overlap_volumes(*boxes, pairs), [0.5, 1.0], rtol=1e-6)


def test_boxes_touch_on_the_rectangle_that_their_faces_share() -> None:
    centres = np.array([[0.0, 0, 0], [0.5, 0.5, 1.0]])
    rows, points, normals = box_contacts(centres, np.tile(np.eye(3), (2, 1, 1)), np.full((2, 3), 0.5), PAIR, 1e-6)
    assert rows.tolist() == [0] * 4
    corners = sorted(np.round(points, 6).tolist())
    assert corners == [[0, 0, 0.5], [0, 0.5, 0.5], [0.5, 0, 0.5], [0.5, 0.5, 0.5]]
    np.testing.assert_allclose(normals, np.tile([0, 0, -1], (4, 1)))  # from the second, above, to the first


def test_crossed_edges_touch_in_one_point() -> None:
    half = np.sqrt(0.5)
    along_x = np.array([[1, 0, 0], [0, half, half], [0, -half, half]])
    along_y = np.array([[0, 1, 0], [half, 0, half], [-half, 0, half]])
    centres = np.array([[0.3, 0, 0], [0, 0.2, 2 * half * 0.5 * 2]])
    halves = np.array([[1, 0.5, 0.5], [1, 0.5, 0.5]])
    _, points, normals = box_contacts(centres, np.stack([along_x, along_y]), halves, PAIR, 1e-6)
    np.testing.assert_allclose(points, [[0, 0, half]], atol=1e-9)
    np.testing.assert_allclose(normals, [[0, 0, -1]], atol=1e-9)
