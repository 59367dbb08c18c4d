"""Patches and overlap of meshes against those of the same bodies as boxes, and flat geometry against scipy."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stages.shape.geometry.polygons import convex_hull, inside_margin
from stages.shape.physics.contacts import PairContacts
from stages.shape.physics.solids import MeshSolids, PlacedParts
from stages.shape.shape import Shape
from tests.stages.shape.geometry.bodies import box, prism, sphere
from tests.stages.shape.physics.structures import solid, studded

PAIR = np.array([[0, 1]], dtype=np.int32)


def asked(shape: Shape) -> tuple[PairContacts, PlacedParts]:
    solids = MeshSolids(shape.meshes)
    return PairContacts(shape.meshes, solids), PlacedParts.of(shape.meshes, solids, shape.assembly, shape.up)


@given(st.floats(-0.9, 0.9), st.floats(-0.9, 0.9), st.floats(-0.02, 0.02))
def test_meshes_touch_on_the_patch_of_their_boxes(x: float, y: float, gap: float) -> None:
    stacked = box(at=(0, 0, 0.5)), box(at=(x, y, 1.5 + gap))
    hulls = []
    for bodies in (stacked, tuple(map(studded, stacked))):
        touch, at = asked(solid(*bodies))
        patches, locked = touch.patches(at, PAIR, 0.03)
        assert not locked.any()
        np.testing.assert_allclose(patches.normals, np.tile([0, 0, -1.0], (len(patches.points), 1)), atol=1e-9)
        np.testing.assert_allclose(patches.points[:, 2], 1 + gap / 2, atol=1e-5)
        hulls.append(sorted(np.round(patches.points[:, :2], 4).tolist()))
    assert hulls[1] == pytest.approx(hulls[0], abs=2e-4) if not hulls[0] else len(hulls[1]) == 4
    np.testing.assert_allclose(np.ptp(hulls[1], axis=0), [1 - abs(x), 1 - abs(y)], atol=1e-3)


@given(st.integers(0, 10**6))
def test_meshes_share_the_volume_of_their_boxes(seed: int) -> None:
    rng = np.random.default_rng(seed)
    bodies = [box(*rng.uniform(0.5, 1.5, 3), at=tuple(rng.uniform(-0.3, 0.3, 3))) for _ in range(2)]
    touch, at = asked(solid(*bodies))
    exact, depth = touch.overlaps(at, PAIR)
    touch, at = asked(solid(*map(studded, bodies)))
    sampled, least = touch.overlaps(at, PAIR)
    assert sampled[0] == pytest.approx(exact[0], rel=0.02)
    assert least[0] <= depth[0] * 1.001


def test_balls_share_the_volume_of_a_lens() -> None:
    vertices, faces = sphere(64, 32)
    touch, at = asked(solid((vertices, faces), (vertices + np.array([1.0, 0, 0]), faces)))
    lens = np.pi * (4 + 1) * (2 - 1) ** 2 / 12
    assert touch.overlaps(at, PAIR)[0][0] == pytest.approx(lens, rel=0.03)


def test_ball_inside_a_box_is_connected_to_it() -> None:
    shape = solid(studded(box(6, 6, 6)), sphere())
    touch, at = asked(shape)
    assert touch.connected(at, 0.01, np.empty((0, 2), np.int32)).tolist() == [[0, 1]]
    apart = solid(studded(box(6, 6, 6)), (sphere()[0] + np.array([5.0, 0, 0]), sphere()[1]))
    touch, at = asked(apart)
    assert not len(touch.connected(at, 0.01, np.empty((0, 2), np.int32)))


def test_edge_on_a_face_touches_along_the_edge() -> None:
    vertices, faces = prism(4, radius=1.0, height=2.0)
    lying = vertices[:, [2, 0, 1]] + np.array([0, 0, 1.0])  # on one of its edges, along x
    touch, at = asked(solid((lying, faces), studded(box(4, 4, 1, at=(0, 0, -0.5)))))
    patches, locked = touch.patches(at, PAIR, 1e-4)
    assert not locked.any()
    np.testing.assert_allclose(patches.normals, np.tile([0, 0, 1.0], (len(patches.points), 1)), atol=1e-6)
    assert np.ptp(patches.points[:, 0]) == pytest.approx(2, abs=1e-3)
    assert np.ptp(patches.points[:, 1]) < 1e-3


def test_volume_and_centroid_are_those_of_the_body() -> None:
    solids = MeshSolids(solid(box(1, 2, 3, at=(1, 1, 1)), studded(box(1, 2, 3, at=(1, 1, 1))), box(sides=5)).meshes)
    assert solids.boxes.tolist() == [True, False, False]
    assert solids.closed.tolist() == [True, True, False]
    np.testing.assert_allclose(solids.volumes, [6, 6, 0])
    np.testing.assert_allclose(solids.areas, [22, 22, 5])
    np.testing.assert_allclose(solids.centroids[:2], np.ones((2, 3)))


@given(st.integers(0, 10**6))
def test_convex_hull_is_that_of_scipy(seed: int) -> None:
    from scipy.spatial import ConvexHull

    points = np.round(np.random.default_rng(seed).normal(size=(12, 2)), 1)
    hull = convex_hull(points)
    truth = ConvexHull(points)
    turn = np.roll(points[hull], -1, axis=0)
    area = (points[hull][:, 0] * turn[:, 1] - points[hull][:, 1] * turn[:, 0]).sum() / 2
    assert area == pytest.approx(truth.volume), "the same area, and counter-clockwise"
    assert len(hull) == len(truth.vertices)


def test_hull_keeps_its_corners_where_sides_are_level_but_for_noise() -> None:
    noise = np.random.default_rng(0).normal(size=(40, 2)) * 1e-16
    ring = np.repeat([[0.0, 0], [1, 0], [1, 1], [0, 1]], 10, axis=0) + noise
    hull = convex_hull(np.concatenate([ring, (ring + np.roll(ring, 10, axis=0)) / 2]))
    assert sorted(np.round(ring[hull % 40]).tolist()) == [[0, 0], [0, 1], [1, 0], [1, 1]]


@pytest.mark.parametrize(
    ("point", "margin"), [((0.5, 0.5), 0.5), ((0.9, 0.5), 0.1), ((1.5, 0.5), -0.5), ((2.0, 2.0), -np.sqrt(2))]
)
def test_margin_is_the_distance_to_the_nearest_side(point: tuple[float, float], margin: float) -> None:
    square = np.array([[0.0, 0], [1, 1], [1, 0], [0, 1]])
    assert inside_margin(square, np.array(point)) == pytest.approx(margin)
    assert inside_margin(square[:2], np.array([0.5, 0.5])) == pytest.approx(0)
