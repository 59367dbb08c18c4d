from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stages.shapeassembly.extraction.boxes import (
    angle_between,
    box_gap,
    boxes_match,
    corners_of_box,
    local_points,
    mirror_points,
    nearest_axes,
    surface_distance,
    world_points,
)
from stages.shapeassembly.extraction.hierarchy import Box
from stages.shapeassembly.extraction.readers.minimum_box import minimum_box
from tests.stages.shapeassembly.extraction.shapes import box, turned

number = st.floats(-2, 2, allow_nan=False)
angle = st.floats(-180, 180, allow_nan=False)
boxes = st.builds(
    lambda center, size, first, second: box(center, size, turned(0, first) @ turned(1, second)),
    st.tuples(number, number, number),
    st.tuples(*[st.floats(0.05, 2)] * 3),
    angle,
    angle,
)


@given(boxes, st.tuples(number, number, number))
def test_local_points_inverts_world_points(some: Box, place: tuple[float, float, float]) -> None:
    np.testing.assert_allclose(local_points(some, world_points(some, np.array(place))), place, atol=1e-9)


@given(boxes)
def test_renaming_the_axes_keeps_the_box_and_turns_it_less_than_half_the_cube_allows(some: Box) -> None:
    renamed = nearest_axes(some, np.eye(3))
    assert boxes_match(corners_of_box(some), corners_of_box(renamed), 1e-9)
    assert np.linalg.det(renamed.axes) == pytest.approx(1.0)
    assert angle_between(renamed.axes, np.eye(3)) <= 62.8 + 1e-6, "the farthest rotation from the 24 of the cube"


@given(boxes, boxes)
def test_gap_is_no_more_than_any_distance_of_points_and_is_reached(first: Box, second: Box) -> None:
    distance, on_first, on_second = box_gap(first, second)
    grid = np.stack(np.meshgrid(*[np.linspace(0, 1, 6)] * 3), axis=-1).reshape(-1, 3)
    away = np.linalg.norm(world_points(first, grid)[:, None] - world_points(second, grid)[None], axis=2)
    assert distance <= away.min() + 1e-2
    assert distance == pytest.approx(float(np.linalg.norm(on_first - on_second)), abs=1e-9)
    for own, point in ((first, on_first), (second, on_second)):
        assert (np.abs(local_points(own, point) - 0.5) <= 0.5 + 1e-9).all()


def test_gap_of_boxes_face_to_face_edge_to_edge_and_crossing() -> None:
    cube = box((0, 0, 0), (1, 1, 1))
    assert box_gap(cube, box((3, 0.2, 0), (1, 1, 1)))[0] == pytest.approx(2.0)
    assert box_gap(cube, box((2, 2, 0), (1, 1, 1)))[0] == pytest.approx(np.sqrt(2))
    assert box_gap(box((0, 0, 0), (9, 0.1, 0.1)), box((0, 0, 0.1), (0.1, 9, 0.1)))[0] == pytest.approx(0.0, abs=1e-9)
    assert box_gap(cube, box((2, 0, 0), (1, 1, 1), turned(2, 45)))[0] == pytest.approx(1.5 - np.sqrt(0.5))


def test_surface_distance_is_exact_inside_and_outside() -> None:
    cube = box((0, 0, 0), (2, 2, 2), turned(1, 90))
    points = np.array([[0.0, 0, 0], [0.75, 0, 0], [3, 0, 0], [2, 2, 0]])
    np.testing.assert_allclose(surface_distance(points, [cube]), [1, 0.25, 2, np.sqrt(2)])
    assert surface_distance(points[:1], [cube, box((0, 0, 0), (0.2, 0.2, 0.2))])[0] == pytest.approx(0.1)


@given(boxes, st.sampled_from([0, 1, 2]))
def test_reflection_twice_is_identity(some: Box, axis: int) -> None:
    corners = corners_of_box(some)
    np.testing.assert_allclose(
        mirror_points(mirror_points(corners, some.center, axis), some.center, axis), corners, atol=1e-12
    )


@given(boxes)
def test_smallest_box_around_the_corners_of_a_box_is_that_box(some: Box) -> None:
    found = minimum_box(corners_of_box(some))
    assert np.prod(found.size) <= np.prod(some.size) * 1.02
    local = np.abs((corners_of_box(some) - found.center) @ found.axes.T)
    assert (local <= found.size / 2 + 1e-9).all()


def test_smallest_box_of_flat_straight_and_single_points_has_no_thickness() -> None:
    slanted = turned(2, 30)
    square = np.array([[0, 0, 0], [2, 0, 0], [2, 0, 1], [0, 0, 1.0]]) @ slanted
    assert sorted(minimum_box(square).size.tolist()) == pytest.approx([0, 1, 2], abs=1e-9)
    line = np.array([[0, 0, 0], [1, 0, 0], [3, 0, 0.0]]) @ slanted
    assert sorted(minimum_box(line).size.tolist()) == pytest.approx([0, 0, 3], abs=1e-9)
    assert minimum_box(np.array([[1.0, 2, 3]])).size.tolist() == [0, 0, 0]
    assert minimum_box(np.array([[1.0, 2, 3]])).center.tolist() == [1, 2, 3]
