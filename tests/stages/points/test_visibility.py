"""Visible points against brute force, and clouds of visible points only."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stages.points.cloud import sample_cloud
from stages.points.visibility import (
    MIN_HIT_DISTANCE_SHARE,
    MIN_VIEW_COSINE,
    VIEW_COUNT,
    seen_from_outside,
    view_directions,
)
from stages.shape.arrays import BoolArray, FloatArray
from stages.shape.geometry.ray_casting import RayCaster
from stages.shape.kit import Assembly, PartMesh
from stages.shape.shape import Shape, kit_shape
from tests.stages.shape.views.solids import box, kit_of, part_type, posed


def shape_of(*parts: PartMesh) -> Shape:
    types = np.arange(len(parts), dtype=np.int16)
    return kit_shape(kit_of(*parts), Assembly(types, posed(*[(0, 0, 0)] * len(parts)), np.empty((0, 2), np.int32)))


def boxes() -> Shape:
    """A box within a box."""
    vertices, faces = box()
    return shape_of(part_type("inner", (0.5 * vertices, faces)), part_type("outer", (vertices, faces)))


def free_ways(points: FloatArray, direction: FloatArray, corners: FloatArray, least: float) -> BoolArray:
    """From which points (n, 3) no triangle (t, 3, 3) is in the way, each asked of each (Möller and Trumbore)."""
    a, along, aside = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    across = np.cross(direction, aside)
    turned = np.einsum("tj,tj->t", along, across)
    away = points[:, None] - a
    u = np.einsum("ntj,tj->nt", away, across) / turned
    q = np.cross(away, along)
    v = np.einsum("ntj,j->nt", q, direction) / turned
    distance = np.einsum("ntj,tj->nt", q, aside) / turned
    return ~((u >= 0) & (v >= 0) & (u + v <= 1) & (distance > least)).any(axis=1)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), count=st.integers(1, 30))
def test_what_is_seen_is_what_brute_force_sees(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    shape = shape_of(
        part_type("soup", (rng.normal(size=(3 * count, 3)), np.arange(3 * count, dtype=np.int32).reshape(-1, 3)))
    )
    casting = RayCaster(shape)
    corners, _ = casting.triangles
    # The middles of the triangles: rounding does not decide about them.
    points = corners.mean(axis=1)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    expected = np.zeros(count, dtype=bool)
    for view in view_directions():
        least = MIN_HIT_DISTANCE_SHARE * casting.size
        expected |= (np.abs(normals @ view) > MIN_VIEW_COSINE) & free_ways(points, view, corners, least)
    assert (seen_from_outside(casting, points, normals) == expected).mean() >= 1.0 - 1.0 / count
    assert (seen_from_outside(casting, points, -normals) == seen_from_outside(casting, points, normals)).all()


def test_a_box_hides_what_is_in_it() -> None:
    cloud = sample_cloud(boxes(), 400, 100, 500, "visible", np.random.default_rng(0))
    assert len(cloud.points) == 500
    assert set(cloud.instances.tolist()) == {1}
    everything = sample_cloud(boxes(), 400, 100, 500, "all", np.random.default_rng(0))
    assert set(everything.instances.tolist()) == {0, 1}


def test_an_open_box_shows_its_floor() -> None:
    vertices, faces = box()
    top = vertices[faces].min(axis=1)[:, 1] > 0.0
    crate = shape_of(part_type("crate", (vertices, faces[~top])))
    cloud = sample_cloud(crate, 2000, 0, 1, "visible", np.random.default_rng(1))
    floor = np.abs(cloud.points[:, 1] - vertices[:, 1].min()) < 1e-9
    assert floor.mean() == pytest.approx(0.2, abs=0.04)


def test_visible_clouds_depend_on_their_stream_alone_and_uniform_points_on_nothing_else() -> None:
    one, again = (sample_cloud(boxes(), 60, 20, 100, "visible", np.random.default_rng(5)) for _ in range(2))
    assert one.points.tobytes() == again.points.tobytes()
    other = sample_cloud(boxes(), 60, 10, 50, "visible", np.random.default_rng(5))
    np.testing.assert_array_equal(one.points[20:], other.points[10:])


def test_views_are_even_however_few_are_needed() -> None:
    views = view_directions()
    assert views.shape == (VIEW_COUNT, 3)
    np.testing.assert_allclose(np.linalg.norm(views, axis=1), 1.0)
    assert len(np.unique(views[:, 1])) == VIEW_COUNT
    for count in (8, 16, VIEW_COUNT):
        assert np.linalg.norm(views[:count].mean(axis=0)) < 0.15
        probes = np.random.default_rng(0).normal(size=(500, 3))
        probes /= np.linalg.norm(probes, axis=1, keepdims=True)
        nearest = (probes @ views[:count].T).max(axis=1)
        # No gap is wider than twice the side of an even share of the sphere.
        assert np.arccos(nearest.min()) < 2.0 * np.sqrt(4.0 * np.pi / count)
