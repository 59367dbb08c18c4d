from __future__ import annotations

import numpy as np
import pytest
import trimesh

from stages.shape.views.buffers import visible_triangles
from stages.shape.views.camera import Camera
from stages.shape.views.corner_normals import CREASE_ANGLE_DEGREES
from stages.shape.views.pixel_normals import smooth_normals
from stages.shape.views.scene import MeshSet, mesh_scene
from stages.shape.views.strokes import find_strokes
from tests.stages.shape.views.solids import box, cylinder


def seen(vertices, faces, camera=None):
    grey = np.full((len(faces), 3), 128, dtype=np.uint8)
    scene = mesh_scene(np.asarray(vertices, dtype=np.float64), np.asarray(faces, dtype=np.int32), grey, "y")
    return visible_triangles(scene, camera or Camera(-35.0, 28.0), (120, 120), "raster")


def degrees(first, second):
    return np.degrees(np.arccos(np.clip((first * second).sum(axis=-1), -1.0, 1.0)))


def test_a_ball_of_flat_faces_has_the_normals_of_a_ball():
    ball = trimesh.creation.icosphere(subdivisions=2)
    view = seen(ball.vertices, ball.faces)
    shown = view.triangles >= 0
    places = ball.vertices[ball.faces[view.triangles[shown]]].mean(axis=1) @ view.view.eye[:3, :3].T
    flat, smooth = view.normals[view.triangles[shown]], smooth_normals(view)[shown]
    assert np.allclose(np.linalg.norm(smooth, axis=1), 1.0, atol=1e-5)
    # within a face the flat normal stands still, and the smooth one goes on as the ball does
    assert degrees(flat, places / np.linalg.norm(places, axis=1)[:, None]).max() < 2.0
    corners = view.scene.meshes.corner_normals.astype(np.float64)
    assert degrees(corners, ball.vertices[ball.faces]).max() < 1.5
    jumps = [
        degrees(image[:, 1:], image[:, :-1])[shown_pairs(view)] for image in (flat_image(view), smooth_normals(view))
    ]
    assert jumps[0].max() > 8.0
    assert jumps[1].max() < 5.0


def flat_image(view):
    image = np.zeros((*view.triangles.shape, 3))
    image[view.triangles >= 0] = view.normals[view.triangles[view.triangles >= 0]]
    return image


def shown_pairs(view):
    """Pairs of neighbouring pixels well inside of the outline, where a pixel covers little of the ball."""
    image = flat_image(view)
    inside = (view.triangles >= 0) & (image[..., 2] > 0.6)
    return inside[:, 1:] & inside[:, :-1]


def test_faces_that_turn_by_more_than_a_crease_stay_flat():
    for mesh in (box(), cylinder(sides=10)):  # of ten sides each turns by 36 degrees
        view = seen(*mesh)
        assert np.allclose(smooth_normals(view), flat_image(view), atol=1e-6)


def test_the_rim_of_a_smooth_cylinder_keeps_its_edge():
    view = seen(*cylinder(sides=32), Camera(0.0, 30.0))
    upright = smooth_normals(view) @ view.view.eye[:3, :3]
    cap = np.abs(flat_image(view) @ view.view.eye[:3, :3] @ [0, 1, 0]) > 0.99
    assert np.allclose(upright[cap], [0, 1, 0], atol=1e-6)
    assert np.abs(upright[(view.triangles >= 0) & ~cap][:, 1]).max() < 1e-6
    assert len(find_strokes(view, CREASE_ANGLE_DEGREES, 0.5, 4.0).kinds) > 0  # and it is drawn


def test_a_small_bevel_does_not_bend_the_large_face_beside_it():
    turn = np.radians(30.0)
    strip = np.array([[0, 0, 0], [0, 0, 1], [10, 0, 0], [10, 0, 1], [10 + np.cos(turn) / 5, -np.sin(turn) / 5, 0]])
    strip = np.vstack([strip, strip[4] + [0, 0, 1]])
    faces = np.array([[0, 1, 2], [2, 1, 3], [2, 3, 4], [4, 3, 5]])
    meshes = MeshSet.of([(strip, faces, np.zeros((4, 3), dtype=np.uint8))])
    assert degrees(meshes.corner_normals[:2], meshes.normals[:2, None]).max() < 2.0


@pytest.mark.parametrize("turned", [False, True])
def test_both_sides_of_a_sheet_face_the_viewer_and_faces_without_area_harm_nothing(turned):
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    faces = np.array([[0, 1, 2], [0, 2, 3], [1, 1, 2]])
    view = seen(corners, faces[:, ::-1] if turned else faces, Camera(0.0, 0.0))
    shown = view.triangles >= 0
    assert shown.any()
    assert np.allclose(smooth_normals(view)[shown], flat_image(view)[shown], atol=1e-6)
    assert (smooth_normals(view)[~shown] == 0).all()
