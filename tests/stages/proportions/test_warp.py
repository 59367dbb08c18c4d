"""Other proportions: equal stays equal, what touches goes on touching, and only what is said changes."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from stages.proportions.warp import Lattice, lattice_of, warped
from stages.proportions.warp_check import warp_fault
from stages.shape.arrays import FloatArray
from stages.shape.geometry.contact import ContactTest, world_boxes
from stages.shape.kit import Assembly
from stages.shape.shape import Shape, kit_shape
from tests.stages.proportions.stools import kit, lattice, whole
from tests.stages.shape.geometry.bodies import box, part, prism


def boxes(shape: Shape) -> np.ndarray:
    return world_boxes(shape.meshes, shape.assembly.types, shape.assembly.poses)


def drawn(seed: int, spread: float = 0.3) -> Shape:
    return warped(kit_shape(kit(), whole()), lattice(), lattice().draw(np.random.default_rng(seed), spread, 2.0))


def test_knots_are_the_ends_of_parts() -> None:
    np.testing.assert_allclose(lattice().knots[0], [-0.5, -0.4, 0.4, 0.5], atol=1e-6)
    np.testing.assert_allclose(lattice().knots[1], [0.0, 0.8, 0.85, 1.0, 1.1], atol=1e-6)
    np.testing.assert_allclose(lattice().knots[2], [-0.05, 0.0, 0.05, 0.45, 0.5, 0.55], atol=1e-6)
    assert lattice().lengths[0][0] == lattice().lengths[0][2] == lattice().lengths[1][3]


def test_factors_of_one_leave_the_exemplar_as_it_is() -> None:
    same = warped(kit_shape(kit(), whole()), lattice(), [np.ones(len(lengths)) for lengths in lattice().lengths])
    np.testing.assert_allclose(boxes(same), world_boxes(kit().types, whole().types, whole().poses), atol=1e-9)
    assert same.labels == kit().labels
    assert [mesh.label for mesh in same.meshes] == [kit().types[kind].label for kind in whole().types]
    assert len(set(same.part_names)) == len(whole())


@given(st.integers(0, 1000))
def test_what_touches_goes_on_touching_and_nothing_else_does(seed: int) -> None:
    shape = drawn(seed)
    test = ContactTest(shape.meshes, kit().contact_tolerance)
    np.testing.assert_array_equal(test.contacts(shape.assembly.types, shape.assembly.poses), whole().edges)
    assert warp_fault(kit(), whole(), shape) is None


@given(st.integers(0, 1000))
def test_equal_lengths_stay_equal_along_all_axes_and_the_mirror_image_remains(seed: int) -> None:
    shape = drawn(seed)
    sides = np.ptp(boxes(shape), axis=1)
    first, second = np.flatnonzero(whole().types == whole().types[0])
    np.testing.assert_allclose(sides[first], sides[second])
    middle = boxes(shape)[:, :, 0].mean(axis=1)
    np.testing.assert_allclose(middle, middle[0], atol=1e-9)
    left, right = post_widths(shape, int(first))
    top = int(np.flatnonzero(whole().types == kit().labels.index("top"))[0])
    assert left == pytest.approx(right) == pytest.approx(sides[top, 1]), "posts are as wide as the top is thick"


def post_widths(shape: Shape, part: int) -> tuple[float, float]:
    """How wide the left and the right post of a frame are at its foot."""
    vertices = shape.meshes[part].vertices
    foot = vertices[vertices[:, 1] < vertices[:, 1].min() + 1e-6, 0]
    ends = np.sort(foot)
    return float(np.ptp(ends[: len(ends) // 2])), float(np.ptp(ends[len(ends) // 2 :]))


def test_the_bar_of_a_frame_stays_beside_the_board_that_lies_on_it() -> None:
    """A part is moved a vertex at a time: as a whole the frame would take its bar elsewhere."""
    factors = [np.ones(len(lengths)) for lengths in lattice().lengths]
    factors[1][0] = 2.0
    shape = warped(kit_shape(kit(), whole()), lattice(), factors)
    frame, board = (int(np.flatnonzero(whole().types == kit().labels.index(name))[0]) for name in ("frame", "board"))
    heights = np.unique(np.round(shape.meshes[frame].vertices[:, 1] + shape.assembly.poses[frame, 1, 3], 6))
    assert boxes(shape)[board, 0, 1] == pytest.approx(heights[-2])


def test_factors_stay_within_their_bounds_and_signatures_know_no_size() -> None:
    for seed in range(20):
        for factors in lattice().draw(np.random.default_rng(seed), 1.0, 1.5):
            assert ((factors >= np.round(1 / 1.5, 3)) & (factors <= 1.5)).all()
    twice = [np.full(len(lengths), 2.0) for lengths in lattice().lengths]
    once = [np.ones(len(lengths)) for lengths in lattice().lengths]
    np.testing.assert_allclose(lattice().signature(twice), lattice().signature(once), atol=1e-9)


@pytest.mark.parametrize("wrong", [[1.0], [1.0, -1.0, 1.0], [1.0, np.nan, 1.0]])
def test_factors_of_another_lattice_are_refused(wrong: list[float]) -> None:
    factors = [np.array(wrong), *(np.ones(len(lengths)) for lengths in lattice().lengths[1:])]
    with pytest.raises(ValueError, match="axis x has 3 intervals and needs one positive factor for each"):
        warped(kit_shape(kit(), whole()), lattice(), factors)


def test_shape_with_lost_contacts_is_rejected() -> None:
    shape = drawn(0)
    top = int(np.flatnonzero(whole().types == kit().labels.index("top"))[0])
    shape.assembly.poses[top, 1, 3] += 0.2
    assert warp_fault(kit(), whole(), shape) == "contact lost"


def drum(sides: int, up: str = "y") -> Shape:
    """A drum on a polygon of `sides`, about y, with a board inside."""
    body, board = part(prism(sides)), part(box(1.2, 0.1, 3.0))
    upright = np.eye(4)
    upright[:3, :3] = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]
    assembly = Assembly(
        np.array([0, 1], dtype=np.int16), np.stack([upright, upright]), np.array([[0, 1]], dtype=np.int32)
    )
    return Shape((body, board), assembly, up, ("drum", "board"))


def radii(made: Shape, part: int, axes: list[int], sides: int) -> FloatArray:
    """Return the distances of the points of a prism from its axis, across two axes, float64 (2 * sides,)."""
    distances: FloatArray = np.linalg.norm(made.meshes[part].vertices[: 2 * sides][:, axes], axis=1)
    return distances


@pytest.mark.parametrize(("up", "sides"), [("y", 8), ("y", 48), ("z", 48)])
def test_what_is_round_stays_round(up: str, sides: int) -> None:
    shape = drum(sides, up)
    knots = lattice_of(shape, 1e-3)
    heights = []
    for seed in range(5):
        made = warped(shape, knots, knots.draw(np.random.default_rng(seed), 0.3, 2.0))
        around = radii(made, 0, [0, 2], sides)
        np.testing.assert_allclose(around, around[0], rtol=1e-6)
        heights.append(np.ptp(made.meshes[0].vertices[:, 1]) / around[0])
    assert len(set(np.round(heights, 3))) == 5


def test_round_parts_stay_round_where_the_whole_is_not() -> None:
    """A vase on a shelf, and two wheels at its ends, alike."""
    sides = 24
    vase, wheel, board = part(prism(sides, height=2.0)), part(prism(sides, height=2.0)), part(box(7.0, 0.3, 2.5))
    upright = np.eye(4)
    upright[:3, :3] = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]
    poses = np.stack([upright, np.eye(4), np.eye(4), np.eye(4)])
    poses[0, :3, 3] = [0.0, 1.15, 0.0]
    poses[1, :3, 3] = [-2.5, -1.15, 1.0]
    poses[2, :3, 3] = [2.5, -1.15, 1.0]
    assembly = Assembly(
        np.array([0, 1, 1, 2], dtype=np.int16), poses, np.array([[0, 3], [1, 3], [2, 3]], dtype=np.int32)
    )
    shape = Shape((vase, wheel, board), assembly, "y", ("vase", "wheel", "board"))
    knots = lattice_of(shape, 1e-3)
    assert not is_free(knots)
    lengths = []
    for seed in range(5):
        made = warped(shape, knots, knots.draw(np.random.default_rng(seed), 0.3, 2.0))
        for number, axes in ((0, [0, 2]), (1, [0, 1]), (2, [0, 1])):
            around = radii(made, number, axes, sides)
            np.testing.assert_allclose(around, around[0], rtol=1e-6)
        assert made.meshes[1].diagonal == pytest.approx(made.meshes[2].diagonal)
        lengths.append(np.ptp(made.meshes[3].vertices[:, 0]) / np.ptp(made.meshes[0].vertices[:, 0]))
    assert len(set(np.round(lengths, 3))) == 5


def is_free(lattice: Lattice) -> bool:
    return lattice.sources.tolist() == list(range(len(lattice.sources)))


def test_a_square_is_not_round_and_a_ball_may_become_flat() -> None:
    assert is_free(lattice())
    assert is_free(lattice_of(drum(4), 1e-3))
    ball = trimesh.creation.icosphere(subdivisions=2)
    body = part((np.asarray(ball.vertices, dtype=np.float64), np.asarray(ball.faces, dtype=np.int32)))
    assembly = Assembly(np.zeros(1, dtype=np.int16), np.eye(4)[None], np.empty((0, 2), dtype=np.int32))
    assert lattice_of(Shape((body,), assembly, "y", ("ball",)), 1e-3).sources.tolist() == [0, 1, 0]


def test_a_round_wire_thinner_than_any_interval_ties_nothing() -> None:
    meshes = part(box(0.05, 0.05, 1.0)), part(prism(16, radius=5e-4, height=1.0))
    poses = np.stack([np.eye(4), np.eye(4)])
    poses[1, 0, 3] = 0.025
    assembly = Assembly(np.arange(2, dtype=np.int16), poses, np.array([[0, 1]], dtype=np.int32))
    assert is_free(lattice_of(Shape(meshes, assembly, "z", ("beam", "wire")), 1e-3))
