"""Where cameras stand, and what a config may ask for."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from stages.shape.views.camera_record import camera_fields
from stages.shape.views.scene import scene_of
from stages.views.cameras import cosine_and_sine, sample_views
from stages.views.placement import bounding_sphere
from stages.views.settings import ViewsConfig, view_count
from stages.views.transforms import transforms_bytes
from tests.stages.views.rendered import lopsided

SCENE = scene_of(lopsided())
AHEAD = [[1, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 4], [0, 0, 0, 1]]
"""A camera on the z axis that looks back along it."""


def cameras(seed: int = 0, **entry: Any) -> list[dict[str, Any]]:
    """The recorded cameras of one entry of a config."""
    config = ViewsConfig.model_validate_json(json.dumps({"cameras": [entry], "width": 96, "height": 64}))
    views = sample_views(config, bounding_sphere(SCENE), lambda index: np.random.default_rng([seed, index]))
    assert len(views) == view_count(config)
    return [camera_fields(view, 96, 64) for _, view in views]


def eyes(recorded: list[dict[str, Any]]) -> np.ndarray:
    """Places of the cameras in radii from the middle of the shape, (n, 3)."""
    sphere = bounding_sphere(SCENE)
    poses = [np.linalg.inv(np.array(camera["world_to_camera"])) for camera in recorded]
    return (np.array([pose[:3, 3] for pose in poses]) - sphere.middle) / sphere.radius


@pytest.mark.parametrize("degrees", [0.0, 30.0, 45.0, 90.0, 137.5, -200.0, 719.0])
def test_sine_and_cosine_are_right_to_the_last_digits(degrees: float) -> None:
    angle = math.radians(degrees)
    assert cosine_and_sine(degrees) == pytest.approx((math.cos(angle), math.sin(angle)), abs=3e-15)


def test_the_bounding_sphere_holds_every_vertex_and_touches_one() -> None:
    sphere = bounding_sphere(SCENE)
    away = np.linalg.norm(SCENE.points - sphere.middle, axis=1)
    assert away.max() == pytest.approx(sphere.radius, rel=1e-12)


def test_a_ring_begins_at_the_front_and_stays_at_its_height() -> None:
    places = eyes(cameras(kind="ring", count=4, elevation=30.0))
    distance = np.linalg.norm(places, axis=1)
    assert distance == pytest.approx(np.full(4, distance[0]))
    assert places[:, 1] == pytest.approx(0.5 * distance)
    flat = places / distance[:, None] / np.cos(np.radians(30.0))
    assert flat[:, [0, 2]] == pytest.approx(np.array([[0, 1], [1, 0], [0, -1], [-1, 0]]), abs=1e-9)


def test_a_sphere_of_cameras_is_spread_evenly_and_turned_by_the_seed_alone() -> None:
    places = eyes(cameras(kind="sphere", count=50))
    directions = places / np.linalg.norm(places, axis=1, keepdims=True)
    near = np.sort(np.degrees(np.arccos(np.clip(directions @ directions.T, -1, 1))), axis=1)[:, 1]
    assert near.min() > 18.0
    assert near.max() < 32.0
    turned = [eyes(cameras(seed, kind="sphere", count=50, turned=True)) for seed in (1, 1, 2)]
    assert (turned[0] == turned[1]).all()
    assert np.abs(turned[0] - turned[2]).max() > 0.01
    assert turned[0][:, 1] == pytest.approx(places[:, 1])


def test_random_cameras_fill_their_band_by_area() -> None:
    places = eyes(cameras(kind="random", count=200, min_elevation=-10.0, max_elevation=60.0))
    sines = places[:, 1] / np.linalg.norm(places, axis=1)
    low, high = math.sin(math.radians(-10.0)), math.sin(math.radians(60.0))
    assert low <= sines.min() < low + 0.05
    assert high - 0.05 < sines.max() <= high
    assert sines.mean() == pytest.approx((low + high) / 2, abs=0.06)


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
def test_a_fitted_camera_sees_the_whole_sphere_with_its_margin(projection: str) -> None:
    sphere, rng = bounding_sphere(SCENE), np.random.default_rng(0)
    points = rng.normal(size=(4000, 3))
    points = sphere.middle + sphere.radius * points / np.linalg.norm(points, axis=1, keepdims=True)
    for camera in cameras(kind="sphere", count=5, projection=projection, margin=0.1):
        x, y, z, _ = np.array(camera["world_to_camera"]) @ np.column_stack([points, np.ones(len(points))]).T
        scale = z if projection == "perspective" else np.ones_like(z)
        across, down, _ = np.array(camera["intrinsics"]) @ np.stack([x / scale, y / scale, np.ones_like(x)])
        assert down.min() == pytest.approx(6.4, abs=0.3)
        assert down.max() == pytest.approx(57.6, abs=0.3)
        assert across.min() > 6.4
        assert across.max() < 89.6


def test_given_poses_are_the_cameras_of_every_shape() -> None:
    (camera,) = cameras(kind="poses", poses=[AHEAD])
    assert eyes([camera]) == pytest.approx(np.array([[0.0, 0.0, 4.0]]))
    assert np.array(camera["world_to_camera"])[:3, :3].tolist() == np.array(AHEAD)[:3, :3].tolist()


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"images": ["color"]}, "views without cameras"),
        ({"cameras": [{"kind": "ring"}], "images": ["mask", "mask"]}, "twice"),
        ({"cameras": [{"kind": "ring"}], "color": {"format": "jpeg", "background": "transparent"}}, "no transparency"),
        ({"cameras": [{"kind": "random", "min_elevation": 5, "max_elevation": 0}]}, "above max_elevation"),
        ({"cameras": [{"kind": "poses", "poses": [[[1, 0, 0, 0]] * 4]}]}, r"poses\[0\] is no 4x4 matrix"),
        ({"cameras": [{"kind": "poses", "poses": [np.diag([1, 1, -1, 1]).tolist()]}]}, "no rotation"),
        ({"cameras": [{"kind": "poses", "poses": [np.eye(4).tolist()]}]}, "ahead; at least 1.05"),
    ],
)
def test_what_makes_no_sense_is_refused(keys: dict[str, Any], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        ViewsConfig.model_validate_json(json.dumps(keys))


def test_nerf_transforms_map_the_camera_to_the_world_with_opengl_axes() -> None:
    recorded = cameras(kind="ring", count=3)
    found = json.loads(transforms_bytes(recorded, [f"color{index}.png" for index in range(3)]))
    for index, (frame, camera) in enumerate(zip(found["frames"], recorded, strict=True)):
        assert frame["file_path"] == f"color{index}.png"
        expected = np.linalg.inv(np.array(camera["world_to_camera"])) @ np.diag([1.0, -1.0, -1.0, 1.0])
        assert np.array(frame["transform_matrix"]) == pytest.approx(expected, abs=1e-8)
        assert frame["fl_x"] == camera["intrinsics"][0][0]
        assert 2 * math.atan(frame["w"] / 2 / frame["fl_x"]) == pytest.approx(frame["camera_angle_x"])
    with pytest.raises(ValueError, match="no orthographic"):
        transforms_bytes(cameras(kind="ring", count=1, projection="orthographic"), ["color0.png"])
