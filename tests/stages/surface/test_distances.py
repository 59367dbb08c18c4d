"""Unions, signed distances and occupancy, in closed form and against trimesh."""

from __future__ import annotations

import json

import numpy as np
import pytest
import trimesh

from pipeline.errors import Rejected
from pipeline.shards import bytes_array
from stages.shape.geometry.mesh_pairs import build_tree, distances_to_surface
from stages.shape.shape import Shape
from stages.surface.distances import cube_around, signed_distances
from stages.surface.settings import DistanceConfig, SurfaceConfig
from stages.surface.stage import surface_members
from stages.surface.union import solids_of, union_mesh
from stages.surface.winding import winding_numbers
from tests.stages.surface.solids import box, shape_of

CROSS = (box((3, 1, 1), (0, 0, 0)), box((1, 3, 1), (0, 0, 0)))
ALL = SurfaceConfig(flags=True, union=True, distances=DistanceConfig(near=300, uniform=200), occupancy=64)


def test_a_union_has_no_inner_faces_and_names_the_parts_of_its_faces() -> None:
    union = union_mesh(solids_of(shape_of(*CROSS)))
    solid = trimesh.Trimesh(union.vertices, union.faces, process=False)
    assert solid.is_watertight
    assert solid.volume == pytest.approx(union.volume) == pytest.approx(5.0)
    assert solid.area == pytest.approx(union.area) == pytest.approx(22.0)
    middles = solid.triangles_center
    assert (np.abs(middles[union.instances == 0][:, 1]) <= 0.5 + 1e-9).all(), (
        "faces of the flat box are no higher than it"
    )
    assert (np.abs(middles[union.instances == 1][:, 0]) <= 0.5 + 1e-9).all()


def test_parts_that_touch_face_to_face_are_one_solid_and_parts_apart_are_two() -> None:
    touching = union_mesh(solids_of(shape_of(box((1, 1, 1), (0, 0, 0)), box((1, 1, 1), (1, 0, 0)))))
    apart = union_mesh(solids_of(shape_of(box((1, 1, 1), (0, 0, 0)), box((1, 1, 1), (1.5, 0, 0)))))
    assert (touching.volume, touching.components) == (pytest.approx(2.0), 1)
    assert (apart.volume, apart.components) == (pytest.approx(2.0), 2)


def test_signed_distances_of_a_box_have_their_closed_form() -> None:
    shape = shape_of(box((2, 1, 3), (5, 0, 0)))
    parts = solids_of(shape)
    middle = np.array([5.0, 0, 0])
    points = (np.random.default_rng(1).uniform(-3, 3, (500, 3)) + middle).astype(np.float32)
    excess = np.abs(points.astype(np.float64) - middle) - np.array([1, 0.5, 1.5])
    expected = np.linalg.norm(np.maximum(excess, 0), axis=1) + np.minimum(excess.max(axis=1), 0)
    np.testing.assert_allclose(signed_distances(parts, union_mesh(parts), points), expected, atol=2e-6)


def test_signed_distances_of_overlapping_parts_are_those_of_trimesh_to_their_union() -> None:
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.8)
    shape = shape_of(*CROSS, ball)
    parts = solids_of(shape)
    union = union_mesh(parts)
    points = np.random.default_rng(2).uniform(-2, 2, (400, 3)).astype(np.float32)
    solid = trimesh.Trimesh(union.vertices, union.faces, process=False)
    expected = -trimesh.proximity.signed_distance(solid, points.astype(np.float64))
    np.testing.assert_allclose(signed_distances(parts, union, points), expected, atol=5e-6)


def test_the_winding_number_is_one_inside_and_zero_outside() -> None:
    ball = trimesh.creation.icosphere(subdivisions=3)
    points = np.array([(0.0, 0, 0), (0.9, 0, 0), (1.1, 0, 0), (5, 5, 5)])
    corners = np.ascontiguousarray(ball.triangles)
    np.testing.assert_allclose(winding_numbers(corners, points), [1, 1, 0, 0], atol=1e-12)


def test_members_hold_what_the_config_asks_for_and_are_the_same_again() -> None:
    shape = shape_of(*CROSS)
    members = surface_members(shape, ALL, np.random.default_rng(5))
    assert members == surface_members(shape_of(*CROSS), ALL, np.random.default_rng(5))
    assert members["sdf_points.npy"] != surface_members(shape, ALL, np.random.default_rng(6))["sdf_points.npy"]
    record = json.loads(members["json"])
    values, points = bytes_array(members["sdf_values.npy"]), bytes_array(members["sdf_points.npy"])
    assert np.abs(values[:300]).mean() < 0.1 < np.abs(values[300:]).mean()
    low, side = np.array(record["union"]["cube_low"]), record["union"]["cube_side"]
    assert ((points[300:] >= low) & (points[300:] <= low + side)).all()
    grid = np.unpackbits(bytes_array(members["occupancy.npy"]), axis=2)
    assert grid.sum() * (side / 64) ** 3 == pytest.approx(5.0, rel=0.1)
    assert record["surface"]["closed"]


def test_the_cube_leaves_a_margin_around_the_longest_side() -> None:
    cube = cube_around(union_mesh(solids_of(shape_of(box((2, 1, 1), (0, 0, 0))))), 0.25)
    assert cube.side == pytest.approx(3.0)
    np.testing.assert_allclose(cube.low, [-1.5, -1.5, -1.5])


def open_box() -> Shape:
    lid = box((1, 1, 1), (0, 0, 0))
    lid.update_faces(np.arange(12) > 1)
    return shape_of(*CROSS, lid)


def crossing_itself() -> Shape:
    """A ball with a dent so deep that it comes out on the other side."""
    ball = trimesh.creation.icosphere(subdivisions=3)
    ball.vertices[ball.vertices[:, 2] > 0.8, 2] -= 3.0
    return shape_of(ball)


def test_a_part_of_several_solids_is_their_union() -> None:
    together = solids_of(shape_of(trimesh.util.concatenate(CROSS)))
    assert [solid.part for solid in together] == [0, 0]
    assert union_mesh(together).volume == pytest.approx(5.0)
    ball = trimesh.creation.icosphere(subdivisions=2)
    hollow = trimesh.util.concatenate([ball, ball.copy().apply_scale(0.5)])
    hollow.faces[len(ball.faces) :] = hollow.faces[len(ball.faces) :, ::-1]
    assert union_mesh(solids_of(shape_of(hollow))).volume == pytest.approx(ball.volume * 7 / 8), "a hollow stays hollow"


def inside_out() -> Shape:
    turned = box((1, 1, 1), (0, 0, 0))
    turned.invert()
    return shape_of(turned)


@pytest.mark.parametrize(
    ("shape", "reason"),
    [
        (open_box(), "open part"),
        (crossing_itself(), "part without a clear inside"),
        (inside_out(), "part inside out"),
    ],
)
def test_shapes_without_a_clear_inside_are_rejected_unless_flags_alone_are_asked_for(shape: Shape, reason: str) -> None:
    with pytest.raises(Rejected) as raised:
        surface_members(shape, ALL, np.random.default_rng(1))
    assert raised.value.reason == reason
    assert list(surface_members(shape, SurfaceConfig(flags=True), np.random.default_rng(1))) == ["json"]


def test_distances_to_slivers_and_faces_are_those_of_trimesh() -> None:
    rng = np.random.default_rng(3)
    vertices = rng.normal(size=(60, 3))
    vertices[2::3] = vertices[0::3] + (vertices[1::3] - vertices[0::3]) * 0.5 + rng.normal(size=(20, 3)) * 1e-12
    vertices[:15] = rng.normal(size=(15, 3))
    faces = np.arange(60, dtype=np.int32).reshape(20, 3)
    points = rng.normal(size=(200, 3)) * 2
    corners = vertices[faces]
    closest = [
        np.linalg.norm(trimesh.triangles.closest_point(corners, np.tile(point, (20, 1))) - point, axis=1).min()
        for point in points
    ]
    np.testing.assert_allclose(distances_to_surface(*build_tree(vertices, faces), points), closest, rtol=1e-9)
