from __future__ import annotations

import hashlib
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from pipeline.errors import ShardFailed
from stages.shape.views.camera import Camera
from stages.shape.views.scene import mesh_scene
from stages.sketches.draw import draw_sketch, jittered_camera
from stages.sketches.settings import SketchesConfig, SketchView, StrokeOptions
from tests.stages.shape.views.solids import boxes_scene, exemplar_scene

ROOT = Path(__file__).resolve().parents[3]
CORNER = Camera(30.0, 25.0)

AGAIN = """
import hashlib
from tests.stages.sketches.test_draw import drawing
print(hashlib.sha256(drawing("raster").tobytes()).hexdigest())
"""


def drawing(renderer):
    scene = boxes_scene([(0, 0, 0), (1, 0.2, 0), (0, 1, 0)], edges=[(0, 1), (0, 2)])
    return draw_sketch(scene, CORNER, 96, 2, StrokeOptions(), renderer)[0]


def test_a_drawing_is_dark_lines_on_white():
    drawn = drawing("raster")
    assert drawn.shape == (96, 96)
    assert drawn.dtype == np.uint8
    assert (drawn[:3] == 255).all()
    assert drawn.min() < 40
    assert 0.6 < (drawn == 255).mean() < 0.97


def test_another_process_draws_the_same_bytes():
    done = subprocess.run([sys.executable, "-c", AGAIN], capture_output=True, text=True, cwd=ROOT, check=True)
    assert done.stdout.strip() == hashlib.sha256(drawing("raster").tobytes()).hexdigest()


@pytest.mark.egl
@pytest.mark.parametrize("shape", ["blocks", "a05_manor_house"])
def test_both_renderers_draw_the_same_picture(shape):
    if shape == "blocks":
        one, two = drawing("egl"), drawing("raster")
    else:
        scene = exemplar_scene(shape)
        one, two = (draw_sketch(scene, CORNER, 224, 2, StrokeOptions(), renderer)[0] for renderer in ("egl", "raster"))
    assert (np.abs(one.astype(int) - two) <= 16).mean() > 0.99


def test_lines_are_about_as_wide_at_any_supersampling():
    scene = boxes_scene([(0, 0, 0)])
    ink = [
        (255 - draw_sketch(scene, CORNER, 128, k, StrokeOptions(), "raster")[0].astype(float)).sum() for k in (1, 2, 4)
    ]
    assert max(ink) / min(ink) < 1.03


def test_a_shape_without_a_line_is_an_error():
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [1, 0, 1]])
    scene = mesh_scene(vertices, np.array([[0, 1, 2]], dtype=np.int32), np.zeros((1, 3), dtype=np.uint8), "y")
    with pytest.raises(ShardFailed, match="blank picture"):
        draw_sketch(scene, Camera(0.0, 0.0), 64, 2, StrokeOptions(), "raster")
    with pytest.raises(ShardFailed, match="blank drawing"):
        draw_sketch(scene, Camera(0.0, 90.0), 64, 2, StrokeOptions(outline=0.0), "raster")


def test_jitter_stays_in_its_bounds_and_depends_on_the_stream_alone():
    view = SketchView(azimuth=10.0, elevation=20.0, azimuth_jitter=5.0, elevation_jitter=3.0, fov_jitter=2.0)
    cameras = [jittered_camera(view, np.random.default_rng(seed)) for seed in range(200)]
    azimuths = np.array([camera.azimuth for camera in cameras])
    elevations = np.array([camera.elevation for camera in cameras])
    assert (np.abs(azimuths - 10) <= 5).all()
    assert np.ptp(azimuths) > 9
    assert (np.abs(elevations - 20) <= 3).all()
    assert (np.abs(np.array([camera.fov for camera in cameras]) - 30) <= 2).all()
    assert jittered_camera(view, np.random.default_rng(7)) == cameras[7]


def test_a_view_without_jitter_stays_where_it_is():
    for view in SketchesConfig().views:
        camera = jittered_camera(view, np.random.default_rng(1))
        assert (camera.azimuth, camera.elevation, camera.fov) == (view.azimuth, view.elevation, view.fov)


def test_impossible_settings_are_refused():
    with pytest.raises(ValueError, match="needs a distance"):
        SketchView(distance_jitter=0.1)
    with pytest.raises(ValueError, match="into the shape"):
        SketchView(distance=1.2, distance_jitter=0.5)
    with pytest.raises(ValueError, match="one name"):
        SketchesConfig(views=(SketchView(name="a"), SketchView(name="a")))
    with pytest.raises(ValueError, match="more than 1"):
        SketchesConfig.model_validate({"augment": {"dilate": 0.7, "erode": 0.7}})


def test_unknown_renderer_is_refused_with_the_names_of_those_that_exist():
    with pytest.raises(ValueError, match="'raster' or 'egl'"):
        SketchesConfig.model_validate({"renderer": "raycast"})


def test_views_can_be_a_list_as_yaml_has_it():
    config = SketchesConfig.model_validate({"views": [{"name": "front", "azimuth": 0.0, "elevation": 10.0}]})
    assert [view.name for view in config.views] == ["front"]
