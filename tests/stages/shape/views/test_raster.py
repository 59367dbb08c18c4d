from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.lib.stride_tricks import sliding_window_view
from scipy.spatial import ConvexHull, Delaunay

from stages.shape.views.buffers import visible_triangles
from stages.shape.views.camera import Camera
from stages.shape.views.layers import layered_moves
from stages.shape.views.raster import raster
from stages.shape.views.scene import mesh_scene
from stages.shape.views.screen import project_triangles
from tests.stages.shape.views.solids import boxes_scene, exemplar_scene

IMAGE_PIXELS = 24
EYES = [Camera(-40.0, 25.0), Camera(35.0, 15.0, fov=60.0), Camera(10.0, 60.0, "orthographic"), Camera(0.0, 0.0)]


def covered(triangles):
    """How often each pixel lies in triangles (t, 3, 3): once for each whose corners turn right, less the others."""
    turns = np.sign(np.linalg.det(triangles[:, 1:, :2] - triangles[:, :1, :2]))
    return sum(
        turn * (raster(triangle[None], IMAGE_PIXELS, IMAGE_PIXELS) == 0)
        for turn, triangle in zip(turns, triangles, strict=True)
    )


def test_a_pixel_belongs_to_the_triangle_that_its_centre_lies_in():
    corner = np.array([[[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]]])
    below = np.add.outer(np.arange(4) + 0.5, np.arange(4) + 0.5) < 4.0
    assert ((raster(corner, 4, 4) == 0) == below).all()
    assert ((raster(corner[:, ::-1], 4, 4) == 0) == below).all()


def test_centres_on_an_edge_belong_to_the_triangle_to_their_right_or_below():
    a, b, c, d = [1.5, 1.5, 0.0], [3.5, 1.5, 0.0], [3.5, 3.5, 0.0], [1.5, 3.5, 0.0]
    square = np.array([[a, b, c], [a, c, d]])
    assert raster(square, 5, 5).tolist() == [[-1] * 5, [-1, 0, 0, -1, -1], [-1, 1, 0, -1, -1], [-1] * 5, [-1] * 5]


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([1, 2, 7, 1000]))
def test_plane_of_triangles_covers_every_pixel_once(seed, grid):
    """With corners on whole and half pixels, so that many edges run through centres, and anywhere."""
    inner = np.round(np.random.default_rng(seed).uniform(-4.0, IMAGE_PIXELS + 4.0, (30, 2)) * grid) / grid
    points = np.concatenate([inner, [[-9.0, -9.0], [-9.0, 40.0], [40.0, -9.0], [40.0, 40.0]]])
    corners = np.concatenate([points, np.zeros((len(points), 1))], axis=1)[Delaunay(points).simplices]
    assert (np.abs(covered(corners)) == 1).all()
    assert (raster(corners, IMAGE_PIXELS, IMAGE_PIXELS) >= 0).all()


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0.0, 3.0]))
def test_a_closed_surface_is_entered_as_often_as_it_is_left_at_every_pixel(seed, crumple):
    """So no pixel falls between two of its triangles, and none into both, whatever the surface and the camera."""
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(40, 3))
    hull = ConvexHull(points)
    turned = np.linalg.det(points[hull.simplices]) < 0.0
    faces = np.where(turned[:, None], hull.simplices[:, ::-1], hull.simplices)
    points += crumple * rng.normal(size=points.shape)
    scene = mesh_scene(points, faces.astype(np.int32), np.zeros((len(faces), 3), dtype=np.uint8), "y")
    camera = Camera(*rng.uniform(-80.0, 80.0, 2), distance=1.2 if seed % 2 else None)
    view = camera.look(scene.points, "y")
    assert (covered(project_triangles(scene, view, layered_moves(scene, view), IMAGE_PIXELS, IMAGE_PIXELS)) == 0).all()


def test_the_nearest_triangle_is_seen_and_of_equals_the_first():
    whole = np.array([[-9.0, -9.0, 0.0], [40.0, -9.0, 0.0], [-9.0, 40.0, 0.0]])
    near, far = whole * 1.0, whole * 1.0
    near[:, 2], far[:, 2] = -0.5, 0.5
    assert (raster(np.array([far, near, whole]), 8, 8) == 1).all()
    assert (raster(np.array([far, whole[[1, 2, 0]], whole, whole[::-1]]), 8, 8) == 1).all()


def test_what_is_seen_does_not_depend_on_the_order_of_triangles():
    rng = np.random.default_rng(3)
    corners = rng.uniform(-5.0, 37.0, (200, 3, 3)) * [1.0, 1.0, 0.02]
    order = rng.permutation(200)
    one, two = raster(corners, 32, 32), raster(corners[order], 32, 32)
    assert (np.where(two >= 0, order[two], -1) == one).all()


def test_triangles_without_area_are_not_seen_and_far_corners_still_are():
    line = np.array([[[1.0, 1.0, 0.0], [5.0, 5.0, 0.0], [9.0, 9.0, 0.0]], [[3.0, 3.0, 0.0]] * 3])
    assert (raster(line, 12, 12) == -1).all()
    huge = np.array([[[-3e6, -3e6, 0.0], [3e6, -3e6, 0.0], [6.5, 3e6, 0.0]]])
    assert (raster(huge, 12, 12) == 0).all()
    assert raster(np.empty((0, 3, 3)), 3, 2).tolist() == [[-1] * 3] * 2


@pytest.mark.parametrize("wrong", [np.inf, np.nan, 1e12])
def test_corners_that_cannot_be_on_any_screen_are_an_error(wrong):
    with pytest.raises(ValueError, match="the camera is inside the shape"):
        raster(np.array([[[0.0, 0.0, 0.0], [wrong, 1.0, 0.0], [1.0, 0.0, 0.0]]]), 8, 8)


def cast(scene, view, side):
    """The triangle of each pixel by Embree, in single precision: one ray through each centre, int64 (side, side)."""
    import open3d as o3d

    faces = scene.meshes.faces[scene.triangle_face]
    moves = layered_moves(scene, view)[scene.triangle_part]
    local = np.concatenate([scene.meshes.vertices[faces], np.ones((len(faces), 3, 1))], axis=2)
    corners = np.einsum("tij,tkj->tki", moves[:, :3], local).astype(np.float32)
    casting = o3d.t.geometry.RaycastingScene(nthreads=1)
    numbers = np.arange(len(corners) * 3, dtype=np.uint32).reshape(-1, 3)
    casting.add_triangles(o3d.core.Tensor.from_numpy(corners.reshape(-1, 3)), o3d.core.Tensor.from_numpy(numbers))
    middles = (np.arange(side) + 0.5) * 2 / side - 1
    rays = np.zeros((side, side, 6), dtype=np.float32)
    start = 3 if view.perspective else 0
    rays[..., start] = middles / view.projection[0, 0]
    rays[..., start + 1] = -middles[:, None] / view.projection[1, 1]
    rays[..., 5] = -1.0
    hits = casting.cast_rays(o3d.core.Tensor.from_numpy(rays), nthreads=1)["primitive_ids"].numpy()
    return np.where(hits == casting.INVALID_ID, -1, hits.astype(np.int64))


@pytest.mark.parametrize("camera", EYES)
@pytest.mark.parametrize("shape", ["soup", "boxes", "a01_castle_tower", "a12_dungeon_room_large", "a26_crossvault"])
def test_embree_sees_the_same_but_for_a_few_pixels_along_edges(shape, camera):
    if shape == "soup":
        points = np.random.default_rng(5).normal(size=(900, 3))
        scene = mesh_scene(points, np.arange(900, dtype=np.int32).reshape(-1, 3), np.zeros((300, 3), np.uint8), "y")
    elif shape == "boxes":
        scene = boxes_scene(np.random.default_rng(6).uniform(0.0, 3.0, (9, 3)))
    else:
        scene = exemplar_scene(shape)
    seen = visible_triangles(scene, camera, (448, 448), "raster")
    differ = seen.triangles != cast(scene, seen.view, 448)
    around = sliding_window_view(np.pad(seen.triangles, 1, mode="edge"), (3, 3))
    within = (around == seen.triangles[:, :, None, None]).all(axis=(2, 3))
    assert differ.mean() < 1e-4
    assert not (differ & within).any()
