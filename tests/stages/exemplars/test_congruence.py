"""Congruences of meshes: symmetry groups, mirror images and tolerances."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stages.exemplars.congruence import comparable_mesh, congruences
from stages.shape.arrays import FloatArray
from stages.shape.geometry.pose import transform_points
from tests.stages.shape.geometry.bodies import Body, box, hull, joined, placed, prism, random_rotation, sheet, sphere

SHARE_TOLERANCE = 1e-3
TETRAHEDRON: Body = (
    np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1.0]]),
    np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]], dtype=np.int32),
)
SCALENE: Body = (np.array([[0, 0, 0], [3, 0, 0], [0.4, 2, 0], [1, 0.5, 1.2]]), TETRAHEDRON[1])
HELIX = joined(box(), box(at=(1, 0, 0)), box(at=(1, 1, 0)), box(at=(1, 1, 1)))
"""Four cubes in a screw, which no rotation maps to their mirror image."""


def group(body: Body, reflections: bool = False) -> FloatArray:
    shape = comparable_mesh(*body)
    return congruences(shape, shape, SHARE_TOLERANCE, reflections)


def mirrored(body: Body) -> Body:
    return body[0] * [1, 1, -1], np.ascontiguousarray(body[1][:, ::-1])


def moved(body: Body, pose: FloatArray) -> Body:
    return transform_points(pose, body[0]), body[1]


def split(body: Body) -> Body:
    """Return the same surface with four triangles for one."""
    vertices, faces = body
    corners = vertices[faces]
    middles = (corners + np.roll(corners, -1, axis=1)) / 2
    a, b, c = np.moveaxis(corners, 1, 0)
    ab, bc, ca = np.moveaxis(middles, 1, 0)
    soup = np.stack([a, ab, ca, b, bc, ab, c, ca, bc, ab, bc, ca], axis=1).reshape(-1, 3)
    return soup, np.arange(len(soup), dtype=np.int32).reshape(-1, 3)


ORDERS = {
    "cube": (box(), 24),
    "brick": (box(1, 2, 3), 4),
    "square brick": (box(1, 1, 2), 8),
    "tetrahedron": (TETRAHEDRON, 12),
    "scalene tetrahedron": (SCALENE, 1),
    "triangular prism": (prism(3), 6),
    "pentagonal prism": (prism(5), 10),
    "hexagonal prism": (prism(6), 12),
    "rod of 24 sides": (prism(24, 0.5, 4.0), 48),
    "ball of 12 meridians": (sphere(12, 6), 24),
    "ball of 7 meridians and 5 parallels": (sphere(7, 5), 14),
    "cube without its lid": (box(sides=5), 4),
    "square sheet": (sheet(), 8),
    "oblong sheet": (sheet(2, 1), 4),
    "screw of cubes": (HELIX, 2),
}


@pytest.mark.parametrize("name", ORDERS)
def test_rotations_of_a_solid_are_those_of_its_group(name: str) -> None:
    body, order = ORDERS[name]
    motions = group(body)
    assert len(motions) == order
    np.testing.assert_array_equal(motions[0], np.eye(4))
    rotations = motions[:, :3, :3]
    np.testing.assert_allclose(np.linalg.det(rotations), 1.0)
    products = np.einsum("aij,bjk->abik", rotations, rotations).reshape(-1, 9)
    gaps = np.abs(products[:, None] - rotations.reshape(1, -1, 9)).max(axis=2)
    assert gaps.min(axis=1).max() < 1e-6, "the product of two of them is one of them"
    apart = np.abs(rotations[:, None] - rotations[None]).max(axis=(2, 3)) + np.eye(order)
    assert apart.min() > 1e-2, "none of them stands twice"


@pytest.mark.parametrize(("name", "order"), [("cube", 48), ("tetrahedron", 24), ("brick", 8), ("pentagonal prism", 20)])
def test_reflections_double_the_group_of_a_solid_that_has_any(name: str, order: int) -> None:
    motions = group(ORDERS[name][0], reflections=True)
    assert len(motions) == order
    np.testing.assert_array_equal(motions[0], np.eye(4))
    assert (np.linalg.det(motions[:, :3, :3]) < 0).sum() == order // 2


def test_triangulation_makes_no_difference() -> None:
    for body, order in (ORDERS["cube"], ORDERS["pentagonal prism"], ORDERS["cube without its lid"]):
        assert len(group(split(body))) == order
        assert len(congruences(comparable_mesh(*body), comparable_mesh(*split(body)), SHARE_TOLERANCE, False)) == order


def test_triangles_without_area_make_no_difference() -> None:
    vertices, faces = box()
    flat = np.concatenate([faces, [[0, 1, 1], [0, 0, 0]]]).astype(np.int32)
    assert len(group((vertices, flat))) == 24


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_only_the_applied_rigid_transform_of_a_random_mesh_is_found(seed: int) -> None:
    rng = np.random.default_rng(seed)
    body = hull(rng)
    pose = placed(*rng.uniform(-100, 100, 3), random_rotation(rng))
    order = rng.permutation(len(body[0]))
    renamed = body[0][order], np.argsort(order)[body[1]][rng.permutation(len(body[1]))].astype(np.int32)
    motions = congruences(comparable_mesh(*body), comparable_mesh(*moved(renamed, pose)), SHARE_TOLERANCE, False)
    assert len(motions) == 1
    np.testing.assert_allclose(motions[0], pose, atol=1e-6)


@pytest.mark.parametrize("name", ORDERS)
def test_every_rigid_transform_between_two_placements_is_found(name: str) -> None:
    body, order = ORDERS[name]
    pose = placed(3, -2, 7, random_rotation(np.random.default_rng(4)))
    source, target = comparable_mesh(*body), comparable_mesh(*moved(body, pose))
    motions = congruences(source, target, SHARE_TOLERANCE, False)
    assert len(motions) == order
    assert min(np.abs(motion - pose).max() for motion in motions) < 1e-6


def test_screw_and_its_mirror_image_are_two_types_unless_reflections_count() -> None:
    left, right = comparable_mesh(*HELIX), comparable_mesh(*mirrored(HELIX))
    assert len(congruences(left, right, SHARE_TOLERANCE, reflections=False)) == 0
    motions = congruences(left, right, SHARE_TOLERANCE, reflections=True)
    assert len(motions) == 2
    assert (np.linalg.det(motions[:, :3, :3]) < 0).all()


def test_small_rotation_of_a_long_part_is_no_symmetry() -> None:
    """The rotation moves all of the part by less than the tolerance, for any part."""
    vertices, faces = prism(6, 1.0, 60.0)
    turn = np.array([0.0, 0.01, 2.0, 2.01, 4.0, 4.01])
    reach = np.array([1.0, 1.0, 0.8, 0.8, 0.6, 0.6])
    ring = reach[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])
    vertices[:12, :2] = np.tile(ring, (2, 1))
    assert len(group((vertices, faces))) == 1
    pose = placed(3, -2, 7, random_rotation(np.random.default_rng(4)))
    other = comparable_mesh(*moved((vertices, faces), pose))
    motions = congruences(comparable_mesh(vertices, faces), other, SHARE_TOLERANCE, False)
    assert len(motions) == 1


def test_random_mesh_is_no_mirror_image_of_itself() -> None:
    for seed in range(5):
        body = hull(np.random.default_rng(seed))
        assert len(congruences(comparable_mesh(*body), comparable_mesh(*mirrored(body)), SHARE_TOLERANCE, False)) == 0
        assert len(congruences(comparable_mesh(*body), comparable_mesh(*mirrored(body)), SHARE_TOLERANCE, True)) == 1


def test_closed_and_open_boxes_are_not_congruent() -> None:
    assert len(congruences(comparable_mesh(*box()), comparable_mesh(*box(sides=5)), SHARE_TOLERANCE, False)) == 0
    assert len(congruences(comparable_mesh(*box(sides=5)), comparable_mesh(*box()), SHARE_TOLERANCE, False)) == 0


def test_balls_of_other_tessellations_are_other_surfaces() -> None:
    assert (
        len(congruences(comparable_mesh(*sphere(16, 8)), comparable_mesh(*sphere(18, 8)), SHARE_TOLERANCE, False)) == 0
    )


def test_tolerance_is_a_share_of_the_diagonal() -> None:
    brick = comparable_mesh(*box(1, 2, 3))
    assert len(congruences(brick, comparable_mesh(*box(1, 2, 3.003)), SHARE_TOLERANCE, False)) == 4
    assert len(congruences(brick, comparable_mesh(*box(1, 2, 3.03)), SHARE_TOLERANCE, False)) == 0
    tiny = comparable_mesh(*box(1e-4, 2e-4, 3e-4))
    assert len(congruences(tiny, comparable_mesh(*box(1e-4, 2e-4, 3.0003e-4)), SHARE_TOLERANCE, False)) == 4


def test_noise_below_the_tolerance_changes_nothing() -> None:
    rng = np.random.default_rng(6)
    for name in ("cube", "brick", "hexagonal prism"):
        (vertices, faces), order = ORDERS[name]
        noisy = vertices + rng.uniform(-1, 1, vertices.shape) * 1e-4
        assert len(group((noisy, faces))) == order
        exact, shaken = comparable_mesh(vertices, faces), comparable_mesh(noisy, faces)
        assert len(congruences(exact, shaken, SHARE_TOLERANCE, False)) == order


def test_comparable_mesh_holds_corners_and_edge_middles() -> None:
    shape = comparable_mesh(*moved(box(1, 2, 3), placed(10, 20, 30)))
    np.testing.assert_allclose(shape.centroid, [10, 20, 30])
    assert shape.area == pytest.approx(22.0)
    assert shape.diagonal == pytest.approx(np.sqrt(14))
    assert len(comparable_mesh(*split(box())).vertices) == 8 + 18, "corners and the middles of edges, each once"
