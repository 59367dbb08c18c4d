from __future__ import annotations

import numpy as np
import pytest

from stages.shape.geometry.penetration import PenetrationTest, _inside_box, depth_bound
from stages.shape.geometry.pose import invert, transform_points
from tests.stages.shape.geometry.bodies import Body, box, part, placed, prism, random_rotation


def depth(one: Body, other: Body, pose: np.ndarray) -> float:
    test = PenetrationTest([part(one), part(other)])
    found = test.depth(0, 1, pose)
    assert test.depth(1, 0, invert(pose)) == pytest.approx(found, abs=1e-5)
    return found


def test_parts_that_only_touch_or_are_apart_have_no_depth() -> None:
    assert depth(box(), box(), placed(1, 0, 0)) == pytest.approx(0.0, abs=1e-6)
    assert depth(box(), box(), placed(1.5, 0, 0)) == 0.0
    assert depth(box(), box(), placed(0.9, 0.9, 1.2)) == 0.0


@pytest.mark.parametrize("overlap", [0.05, 0.2, 0.4])
def test_a_box_pushed_into_another_is_as_deep_as_it_was_pushed(overlap: float) -> None:
    assert depth(box(3, 3, 3), box(), placed(2 - overlap, 0.1, 0.2)) == pytest.approx(overlap, abs=1e-3)


def test_a_box_in_the_middle_of_another_is_as_deep_as_the_wall_around_it() -> None:
    assert depth(box(2, 2, 2), box(0.5, 0.5, 0.5), np.eye(4)) == pytest.approx(0.75, abs=1e-4)


def test_depth_does_not_depend_on_how_the_pair_stands() -> None:
    rng = np.random.default_rng(3)
    pose = placed(0.7, 0.3, 0.1)
    straight = depth(box(), prism(5, 0.5, 1.0), pose)
    turn = placed(rotation=random_rotation(rng))
    (vertices, faces), other = box(), prism(5, 0.5, 1.0)
    assert depth((vertices @ turn[:3, :3].T, faces), other, turn @ pose) == pytest.approx(straight, abs=1e-4)


def test_what_hovers_over_an_open_cup_has_no_depth() -> None:
    assert depth(box(1, 1, 1, sides=5), box(0.2, 0.2, 0.2), placed(0, 0, 0.9)) == 0.0


def test_a_thousand_types_are_tested_in_one_process() -> None:
    """Open3D crashed where each kept its scene."""
    test = PenetrationTest([part(box(1.0, 1.0, 1.0)) for _ in range(1200)])
    pushed = placed(0.9, 0.0, 0.0)
    assert all(test.depth(0, kind, pushed) == pytest.approx(0.1, abs=1e-6) for kind in range(1, 1200))


def test_the_bound_by_boxes_is_the_least_overlap() -> None:
    first = np.array([[0, 0, 0], [4, 4, 4.0]])
    second = np.array([[3, 2, -1], [9, 9, 1.0]])
    assert depth_bound(first, second) == 1.0
    assert depth_bound(second, first) == 1.0


def test_there_is_no_bound_where_one_box_holds_the_other() -> None:
    assert depth_bound(np.array([[0, 0, 0], [4, 4, 4.0]]), np.array([[1, 1, 1], [2, 2, 2.0]])) == np.inf
    # Along z the first holds the second; along x and y it does not.
    assert depth_bound(np.array([[0, 0, 0], [4, 4, 4.0]]), np.array([[3, 3.5, 1], [5, 5, 2.0]])) == 0.5


def test_no_depth_of_a_solid_exceeds_the_bound() -> None:
    rng = np.random.default_rng(8)
    types = [part(box()), part(box(0.5, 2, 1))]
    test = PenetrationTest(types)
    for _ in range(30):
        shift = rng.uniform(-1, 1, 3)
        bound = depth_bound(types[0].bounds, types[1].bounds + shift)
        assert test.depth(0, 1, placed(*shift)) <= max(bound, 0.0) + 1e-4


@pytest.mark.parametrize(
    ("pose", "deep"),
    [(placed(1.5, 0, 0), 0.0), (placed(0.1, 0.2, -0.1), 0.95), (placed(2.6, 0, 0), 0.0)],
)
def test_depth_of_separate_surfaces_equals_that_of_all_points(pose: np.ndarray, deep: float) -> None:
    test = PenetrationTest([part(box(2, 2, 2)), part(box(0.5, 0.5, 0.5))])
    assert test.depth(0, 1, pose, apart=True) == test.depth(0, 1, pose) == pytest.approx(deep, abs=1e-4)
    assert test.depth(1, 0, invert(pose), apart=True) == pytest.approx(deep, abs=1e-4)


def test_probes_near_a_box_are_those_that_lie_in_it_once_they_are_moved() -> None:
    rng = np.random.default_rng(4)
    points, limits = rng.normal(size=(500, 3)), np.array([[-0.5, -0.2, 0.0], [0.4, 0.9, 1.0]])
    for _ in range(20):
        pose = placed(*rng.normal(size=3) / 2, rotation=random_rotation(rng))
        moved = transform_points(pose, points)
        inside = np.all((moved > limits[0]) & (moved < limits[1]), axis=1)
        np.testing.assert_allclose(_inside_box(np.ascontiguousarray(points.T), pose, limits), moved[inside])
