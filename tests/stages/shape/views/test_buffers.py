from __future__ import annotations

import numpy as np
import pytest

from pipeline.errors import ShardFailed
from stages.shape.views import buffers as module
from stages.shape.views import opengl
from stages.shape.views.buffers import render_buffers, renderer_version, visible_triangles
from stages.shape.views.camera import Camera
from stages.shape.views.opengl import OpenGLRenderer
from stages.shape.views.renderer_check import check_in_subprocess
from stages.shape.views.scene import mesh_scene
from tests.stages.shape.views.solids import box, boxes_scene, cylinder, exemplar_scene

FRONT = Camera(0.0, 0.0, "orthographic", margin=0.25)

RENDERER_PARAMS = [pytest.param("egl", marks=pytest.mark.egl), "raster"]


@pytest.mark.parametrize("renderer", RENDERER_PARAMS)
def test_a_box_from_in_front_is_a_square_of_exact_depth_normal_part_and_colour(renderer):
    buffers = render_buffers(boxes_scene([(5.0, 6.0, 7.0)]), FRONT, (8, 8), 4, renderer)
    inside = np.zeros((32, 32), dtype=bool)
    inside[8:24, 8:24] = True
    radius = np.sqrt(3) / 2
    assert (buffers.part == np.where(inside, 0, -1)).all()
    assert np.allclose(buffers.depth[inside], 3 * radius - 0.5, atol=1e-6)
    assert np.isinf(buffers.depth[~inside]).all()
    assert np.allclose(buffers.normal[inside], [0, 0, 1])
    assert (buffers.normal[~inside] == 0).all()
    assert (buffers.color[inside] == (180, 120, 90)).all()
    assert (buffers.color[~inside] == 255).all()


@pytest.mark.parametrize("renderer", RENDERER_PARAMS)
def test_perspective_depth_is_distance_along_the_axis(renderer):
    scene = boxes_scene([(0.0, 0.0, 0.0)])
    camera = Camera(0.0, 0.0, fov=40.0)
    buffers = render_buffers(scene, camera, (64, 64), 1, renderer)
    view = camera.look(scene.points, "y")
    assert np.allclose(buffers.depth[buffers.part == 0], view.depth - 0.5, atol=1e-6)


@pytest.mark.parametrize("renderer", RENDERER_PARAMS)
def test_faces_are_seen_from_both_sides_with_normals_towards_the_viewer(renderer):
    vertices = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    for faces in ([[0, 1, 2], [0, 2, 3]], [[0, 2, 1], [0, 3, 2]]):
        colors = np.zeros((2, 3), dtype=np.uint8)
        scene = mesh_scene(vertices, np.array(faces, dtype=np.int32), colors, "y")
        buffers = render_buffers(scene, FRONT, (16, 16), 1, renderer)
        assert (buffers.normal[buffers.part == 0] == [0, 0, 1]).all()


@pytest.mark.parametrize("renderer", RENDERER_PARAMS)
@pytest.mark.parametrize("camera", [FRONT, Camera(33.0, 21.0), Camera(-70.0, 5.0, "orthographic")])
def test_where_faces_of_two_parts_coincide_the_lower_layer_is_seen(renderer, camera):
    scene = boxes_scene([(0, 0, 0), (0, 0, 0)], edges=[(0, 1)])
    buffers = render_buffers(scene, camera, (64, 64), 1, renderer)
    assert set(np.unique(buffers.part)) == {-1, 0}


@pytest.mark.egl
@pytest.mark.parametrize(
    "camera", [Camera(-40.0, 25.0), Camera(35.0, 15.0, fov=60.0), Camera(10.0, 60.0, "orthographic")]
)
@pytest.mark.parametrize(
    "shape", ["blocks", "cylinder", "a01_castle_tower", "a12_dungeon_room_large", "a26_crossvault"]
)
def test_both_backends_agree_on_99_percent_of_the_pixels(shape, camera):
    if shape == "blocks":
        places = [(x, y, z) for x in range(3) for y in range(3) for z in range(3) if (x + 2 * y + z) % 3]
        sizes = [(1.0, 1.0 + 0.2 * (k % 2), 1.0) for k in range(len(places))]
        touching = [
            (i, j) for j in range(len(places)) for i in range(j) if np.abs(np.subtract(places[i], places[j])).max() <= 1
        ]
        scene = boxes_scene(places, sizes, touching)
    elif shape == "cylinder":
        vertices, faces = cylinder()
        scene = mesh_scene(vertices, faces, np.full((len(faces), 3), 9, dtype=np.uint8), "y")
    else:
        scene = exemplar_scene(shape)
    one, two = (render_buffers(scene, camera, (112, 112), 2, renderer) for renderer in ("egl", "raster"))
    same_depth = np.isclose(one.depth, two.depth, rtol=1e-4) | (one.depth == two.depth)
    same_normal = np.abs(one.normal - two.normal).max(axis=2) < 0.01
    same_part = one.part == two.part
    shown = (one.part >= 0) | (two.part >= 0)
    for same in (same_depth, same_normal, same_part):
        assert same[shown].mean() >= 0.99


@pytest.mark.parametrize("renderer", RENDERER_PARAMS)
def test_a_shape_a_million_units_away_looks_the_same(renderer):
    vertices, faces = box((1.0, 0.7, 0.4))
    colors = np.zeros((12, 3), dtype=np.uint8)
    near = mesh_scene(vertices, faces, colors, "y")
    far = mesh_scene(vertices + 1e6, faces, colors, "y")
    camera = Camera(30.0, 20.0)
    same = (
        visible_triangles(near, camera, (96, 96), renderer).triangles
        == visible_triangles(far, camera, (96, 96), renderer).triangles
    )
    assert same.mean() > 0.995


@pytest.mark.parametrize("renderer", RENDERER_PARAMS)
def test_the_same_view_gives_the_same_pixels_again_and_with_a_new_context(renderer, monkeypatch):
    scene = boxes_scene([(0, 0, 0), (0.9, 0.3, 0.1)])
    camera = Camera(30.0, 20.0)
    first = visible_triangles(scene, camera, (64, 64), renderer).triangles
    other = visible_triangles(boxes_scene([(0, 0, 0)]), camera, (80, 60), renderer).triangles
    monkeypatch.setattr(module, "MAX_RENDERS_PER_CONTEXT", 1)
    again = visible_triangles(scene, camera, (64, 64), renderer).triangles
    assert other.shape == (60, 80)
    assert (first == again).all()


@pytest.mark.egl
def test_lost_context_is_replaced():
    scene = boxes_scene([(0, 0, 0)])
    first = visible_triangles(scene, FRONT, (32, 32), "egl").triangles
    other = OpenGLRenderer()
    # Both contexts share one display, and closing one of them ends it for both.
    other.close()
    assert (visible_triangles(scene, FRONT, (32, 32), "egl").triangles == first).all()


@pytest.mark.parametrize("renderer", RENDERER_PARAMS)
def test_a_blank_picture_is_an_error(renderer):
    flat = np.array([[0.0, 0, 0], [1, 0, 0], [0, 0, 1]])
    scene = mesh_scene(flat, np.array([[0, 1, 2]], dtype=np.int32), np.zeros((1, 3), dtype=np.uint8), "y")
    with pytest.raises(ShardFailed, match="blank picture"):
        render_buffers(scene, Camera(0.0, 0.0), (32, 32), 1, renderer)


@pytest.mark.egl
def test_opengl_is_drawn_in_software_whatever_the_environment_says(monkeypatch):
    for name, value in (("LIBGL_ALWAYS_SOFTWARE", "0"), ("GALLIUM_DRIVER", "softpipe"), ("EGL_DEVICE_ID", "7")):
        monkeypatch.setenv(name, value)
    check_in_subprocess.cache_clear()
    fault = check_in_subprocess("egl")
    assert fault is None
    assert renderer_version("egl").startswith("llvmpipe")


@pytest.mark.egl
def test_another_rasteriser_than_the_one_promised_does_not_draw(monkeypatch):
    monkeypatch.setattr(opengl, "RASTERISER", "some card")
    with pytest.raises(RuntimeError, match=r"llvmpipe .* would draw"):
        OpenGLRenderer()
