"""Images show what rays meet, cast by brute force with nothing but the cameras of the record."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.ndimage import maximum_filter, minimum_filter

from stages.shape.views.palette import linear_to_srgb, srgb_to_linear
from stages.views import shading
from stages.views.reading import SampleView
from tests.stages.views.rendered import cast, lopsided, rays_of, triangles_of, views_of

SHAPE = lopsided()
CORNERS, PARTS, COLORS = triangles_of(SHAPE)
SIZE = float(np.ptp(CORNERS.reshape(-1, 3), axis=0).max())
SPACES = {"camera": {"normals_space": "camera"}, "world": {"normals_space": "world", "multichannel": True}}


@cache
def views(space: str = "camera") -> tuple[SampleView, ...]:
    return views_of(SHAPE, **SPACES[space])


@cache
def hits(index: int) -> tuple[np.ndarray, np.ndarray]:
    """Distance and triangle of each pixel of a view, (h, w)."""
    origins, directions = rays_of(views()[index].camera)
    distance, triangle = cast(CORNERS, origins.reshape(-1, 3), directions.reshape(-1, 3))
    return distance.reshape(origins.shape[:2]), triangle.reshape(origins.shape[:2])


def inner(numbers: np.ndarray) -> np.ndarray:
    """Pixels whose neighbours have the same number."""
    return maximum_filter(numbers, 3) == minimum_filter(numbers, 3)


@pytest.mark.parametrize("space", SPACES)
@pytest.mark.parametrize("index", range(6))
def test_depth_parts_and_normals_are_those_of_rays(index: int, space: str) -> None:
    view, (distance, triangle) = views(space)[index], hits(index)
    hit = triangle >= 0
    assert (view.mask != hit).sum() <= 0.002 * hit.size
    part = np.where(hit, PARTS[triangle], -1)
    assert (view.instances != part).sum() <= 0.004 * hit.size
    assert (view.instances == part)[inner(part)].mean() > 0.999
    both = hit & (view.instances == part)
    assert np.abs(view.depth - distance)[both].max() < 1e-4 * SIZE
    expected = np.cross(CORNERS[:, 1] - CORNERS[:, 0], CORNERS[:, 2] - CORNERS[:, 0])[triangle]
    expected /= np.linalg.norm(expected, axis=-1, keepdims=True)
    towards = np.einsum("hwk,hwk->hw", expected, rays_of(view.camera)[1]) < 0
    expected = np.where(towards[..., None], expected, -expected)
    if space == "camera":
        expected = expected @ np.array(view.camera["world_to_camera"])[:3, :3].T
    same = both & inner(triangle // 2)
    angles = np.degrees(np.arccos(np.clip((view.normals * expected).sum(axis=-1), -1.0, 1.0)))
    assert angles[same].max() < 0.5


@pytest.mark.parametrize("space", SPACES)
def test_the_images_of_a_view_agree(space: str) -> None:
    for view in views(space):
        seen = view.mask
        assert seen.any()
        for other in (view.depth > 0, view.normals.any(axis=-1), view.instances >= 0, view.classes >= 0):
            assert (other == seen).all()
        assert (view.classes[seen] == SHAPE.part_classes[view.instances[seen]]).all()
        assert (view.images["drawing"] < 128).any()


def test_points_of_the_depth_lie_on_the_mesh() -> None:
    import trimesh

    mesh = trimesh.Trimesh(CORNERS.reshape(-1, 3), np.arange(3 * len(CORNERS)).reshape(-1, 3), process=False)
    for view in views():
        _, gaps, _ = trimesh.proximity.closest_point(mesh, view.points[::17])
        assert gaps.max() < 1e-4 * SIZE


def test_unlit_colour_is_the_base_colour_of_the_face() -> None:
    for index, view in enumerate(views_of(SHAPE, color={"lighting": "unlit"}, images=["color", "depth"])):
        _, triangle = hits(index)
        sure = inner(np.where(triangle >= 0, PARTS[triangle], -1))
        expected = np.where((triangle >= 0)[..., None], COLORS[triangle], 255)
        assert (view.color == expected)[sure].all()


@pytest.mark.parametrize("shadows", [False, True])
def test_lit_colour_is_that_of_the_formula(shadows: bool) -> None:
    """On flat faces, in double precision; shadows by rays to the lamp, away from their soft borders."""
    azimuth, elevation = np.radians(-50.0), np.radians(50.0)
    around = azimuth + np.radians(shading.FILL_TURN_DEGREES)
    lamp = np.array([np.cos(elevation) * np.sin(azimuth), np.sin(elevation), np.cos(elevation) * np.cos(azimuth)])
    fill = np.array([np.sin(around), 0.0, np.cos(around)])
    rendered = views_of(SHAPE, color={"shadows": shadows}, images=["color"])
    compared = 0
    for index in (0, 3, 4):
        distance, triangle = hits(index)
        origins, directions = rays_of(views()[index].camera)
        normals = np.cross(CORNERS[:, 1] - CORNERS[:, 0], CORNERS[:, 2] - CORNERS[:, 0])[triangle]
        normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
        normals = np.where((normals * directions).sum(axis=-1, keepdims=True) < 0, normals, -normals)
        sure = inner(np.where(triangle >= 0, triangle // 2, -1)) & (triangle >= 0) & (PARTS[triangle] != 2)
        points = origins + np.where(triangle >= 0, distance, 0.0)[..., None] * directions
        lit = np.ones(triangle.shape)
        if shadows:
            starts = (points + 0.02 * normals).reshape(-1, 3)
            blocked = cast(CORNERS, starts, np.broadcast_to(lamp, starts.shape))[1].reshape(triangle.shape) >= 0
            lit = 1.0 - blocked
            sure &= maximum_filter(lit, 7) == minimum_filter(lit, 7)
        light = shading.KEY_LIGHT * np.clip(normals @ lamp, 0, None) * lit + shading.FILL_LIGHT * np.clip(
            normals @ fill, 0, None
        )
        light += shading.SKY_LIGHT * (1 + normals[..., 1]) / 2 + shading.GROUND_LIGHT * (1 - normals[..., 1]) / 2
        expected = linear_to_srgb(srgb_to_linear(COLORS[triangle]) * light[..., None]).astype(int)
        error = np.abs(rendered[index].color.astype(int) - expected).max(axis=-1)
        assert (error[sure] <= 1).mean() > 0.995
        compared += int(sure.sum())
    assert compared > 500


def test_a_transparent_background_has_alpha_and_the_colours_of_the_shape_alone() -> None:
    (white, clear) = (
        views_of(SHAPE, images=["color"], color={"background": background})[0].color
        for background in ("white", "transparent")
    )
    alpha = clear[..., 3:] / 255.0
    assert set(np.unique(clear[..., 3])) == {0, 64, 128, 191, 255}
    over = srgb_to_linear(clear[..., :3]) * alpha + 1.0 - alpha
    assert np.abs(over - srgb_to_linear(white)).max() < 0.01


def test_base_colours_come_back_from_linear_light() -> None:
    grey = np.arange(256, dtype=np.uint8)
    light = np.ones((1, 256, 4), dtype=np.float32)
    light[0, :, :3] = srgb_to_linear(grey)[:, None]
    assert (shading.to_srgb(light, False)[0] == grey[:, None]).all()


@pytest.mark.parametrize(
    ("keys", "names"),
    [
        ({"depth_format": "exr", "normals_format": "exr"}, {"depth0.exr", "normals0.exr", "instances0.png"}),
        ({"color": {"format": "webp", "quality": 95}}, {"color0.webp"}),
        ({"color": {"format": "jpeg", "quality": 95}}, {"color0.jpg"}),
        ({"multichannel": True}, {"view0.exr", "color0.png", "drawing0.png"}),
    ],
)
def test_other_formats_hold_the_same_images(keys: dict[str, object], names: set[str]) -> None:
    from stages.views.settings import ViewsConfig
    from tests.stages.views.rendered import ALL_IMAGES, CAMERAS, files_of

    config = {"cameras": CAMERAS[:1], "width": 96, "height": 80, "images": ALL_IMAGES, **keys}
    files, _ = files_of(SHAPE, ViewsConfig.model_validate(config))
    assert names <= set(files)
    view, usual = views_of(SHAPE, cameras=CAMERAS[:1], **keys)[0], views()[0]
    assert np.abs(view.depth - usual.depth).max() < 1e-4 * SIZE
    assert (view.instances == usual.instances).all()
    assert (view.classes == usual.classes).all()
    assert np.abs(view.normals - usual.normals).max() < 0.006
    assert np.abs(view.color.astype(int) - usual.color).mean() < 2.0
