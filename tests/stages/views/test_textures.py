"""Textures and alpha in colour images, against rays cast in double precision, and against pyrender."""

from __future__ import annotations

import os
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from stages.shape.appearance import Appearance, Material, Texture, TextureImage, barycentric
from stages.shape.shape import Shape
from stages.shape.views.camera import Camera
from stages.shape.views.mesh_look import mesh_look
from stages.shape.views.palette import linear_to_srgb, srgb_to_linear
from stages.shape.views.portrait import portrait
from stages.shape.views.scene import scene_of
from stages.views.reading import SampleView
from tests.stages.views.rendered import cast, lopsided, rays_of, triangles_of, views_of

PIXELS = np.random.default_rng(4).integers(0, 255, (4, 6, 3)).astype(np.uint8)
CAMERAS = [{"kind": "ring", "count": 1, "elevation": 25.0, "azimuth": -40.0}]
FLAT: dict[str, Any] = {
    "cameras": CAMERAS,
    "width": 200,
    "height": 160,
    "images": ["color", "depth", "instances"],
    "color": {"lighting": "unlit", "supersample": 1},
}


def dressed(material: Material, shape: Shape | None = None) -> Shape:
    """Return the shape with one material and coordinates that are planar in the axes of each part."""
    bare = lopsided() if shape is None else shape
    meshes = []
    for mesh in bare.meshes:
        corners = mesh.vertices[mesh.faces]
        uv = (corners @ np.array([[0.4, 0.1], [0.2, -0.5], [-0.1, 0.6]])).astype(np.float32)
        meshes.append(replace(mesh, appearance=Appearance((material,), np.zeros(len(corners), np.int32), uv)))
    return replace(bare, meshes=tuple(meshes))


def hits(shape: Shape, view: SampleView) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the triangle of each pixel, int (n,), -1 for none, its texture coordinates (n, 2), and the corners."""
    corners, _, _ = triangles_of(shape)
    uv = np.concatenate([shape.meshes[kind].appearance.uv for kind in shape.assembly.types])
    origins, directions = (rays.reshape(-1, 3) for rays in rays_of(view.camera))
    distance, triangle = cast(corners, origins, directions)
    seen = triangle >= 0
    points = origins[seen] + distance[seen, None] * directions[seen]
    weights = barycentric(corners[triangle[seen]], points[:, None])
    at = np.full((len(triangle), 2), np.nan)
    at[seen] = (weights @ uv[triangle[seen]])[:, 0]
    return triangle, at, corners


def four_texels(at: np.ndarray, wraps: tuple[str, str]) -> np.ndarray:
    """Return sRGB colours (n, 3) of PIXELS at texture coordinates: the mean of four texels of linear light."""
    light = srgb_to_linear(PIXELS)
    index, share = [], []
    for axis, wrap in enumerate(wraps):
        size = PIXELS.shape[1 - axis]
        place = at[:, axis] * size - 0.5
        ends = np.stack([np.floor(place), np.floor(place) + 1]).astype(int)
        mirrored = np.where(ends % (2 * size) < size, ends % (2 * size), 2 * size - 1 - ends % (2 * size))
        index.append({"repeat": ends % size, "mirror": mirrored, "clamp": np.clip(ends, 0, size - 1)}[wrap])
        share.append(np.stack([1 - (place - np.floor(place)), place - np.floor(place)]))
    total = np.zeros((len(at), 3))
    for i in range(2):
        for j in range(2):
            total += (share[0][i] * share[1][j])[:, None] * light[index[1][j], index[0][i]]
    return linear_to_srgb(total)


@pytest.mark.parametrize("wraps", [("repeat", "mirror"), ("clamp", "repeat")])
@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
def test_textures_are_sampled_where_rays_hit(wraps: tuple[Any, Any], projection: str) -> None:
    shape = dressed(Material("paper", texture=Texture(TextureImage.of(PIXELS), *wraps)))
    (view,) = views_of(shape, **{**FLAT, "cameras": [{**CAMERAS[0], "projection": projection}]})
    triangle, at, _ = hits(shape, view)
    seen = triangle >= 0
    assert seen.sum() > 5000
    difference = np.abs(view.color.reshape(-1, 3)[seen].astype(int) - four_texels(at[seen], wraps)).max(axis=1)
    assert np.quantile(difference, 0.99) <= 1, "pixels at edges may show the neighbour"


def test_the_flat_color_of_a_material_is_exact() -> None:
    shape = dressed(Material("red", (0.5, 0.25, 0.0, 1.0)))
    (view,) = views_of(shape, **FLAT)
    wanted = linear_to_srgb(np.array([0.5, 0.25, 0.0]))
    assert (view.color[view.instances >= 0] == wanted).all()


def test_alpha_mixes_in_linear_light_and_masks_cut_holes() -> None:
    glass = Material("glass", (0.0, 0.0, 1.0, 0.25), alpha_mode="blend")
    solid = lopsided()
    whole = dressed(glass, solid)
    # the first part alone is glass; the others keep the colours of their faces
    mixed = replace(whole, meshes=(whole.meshes[0], *solid.meshes[1:]))
    (before,), (after,) = views_of(solid, **FLAT), views_of(mixed, **FLAT)
    unchanged = (before.instances != 0) & (before.color == after.color).all(axis=2)
    assert unchanged.sum() > 0.95 * (before.instances > 0).sum(), "what is in front of the glass stays"
    seen = (before.instances == 0) & (after.color != 255).any(axis=2)
    one, two = (linear_to_srgb(mixing(layers, np.ones(3))) for layers in (1, 2))
    shown = after.color[seen].astype(int)
    through = (np.abs(shown - one).max(axis=1) <= 1) | (np.abs(shown - two).max(axis=1) <= 1)
    assert through.mean() > 0.5, "white paper behind one or two sides of the glass"
    hole = replace(glass, alpha_mode="mask", alpha_cutoff=0.5)
    cut = dressed(hole, solid)
    (shows,) = views_of(replace(cut, meshes=(cut.meshes[0], *solid.meshes[1:])), **FLAT)
    behind = shows.color[before.instances == 0]
    assert (behind != linear_to_srgb(np.array([0.0, 0.0, 1.0]))).any(axis=1).all()
    assert np.array_equal(shows.depth, before.depth), "depth is that of the surface, whatever its alpha"


def test_portrait_of_what_its_texture_hides_shows_the_surface_without_it() -> None:
    """The part alone of a net whose texture leaves nothing to see has a portrait, that of its bare surface."""
    bare = lopsided()
    hidden = dressed(Material("net", (0.0, 0.0, 1.0, 0.25), alpha_mode="mask", alpha_cutoff=0.5), bare)
    pictures = [portrait(scene_of(shape), Camera(-40.0, 25.0), (120, 90)) for shape in (hidden, bare)]
    assert np.ptp(pictures[1]) > 0
    np.testing.assert_array_equal(*pictures)


def mixing(layers: int, behind: np.ndarray) -> np.ndarray:
    for _ in range(layers):
        behind = 0.25 * np.array([0.0, 0.0, 1.0]) + 0.75 * behind
    return behind


def test_a_transparent_background_shows_how_much_glass_hides() -> None:
    glass = dressed(Material("glass", (0.0, 1.0, 0.0, 0.5), alpha_mode="blend"))
    (view,) = views_of(glass, **{**FLAT, "color": {**FLAT["color"], "background": "transparent"}})
    alphas = np.unique(view.color[..., 3])
    assert set(alphas[alphas > 0].tolist()) <= {128, 191, 192, 223, 224, 239, 240, 247, 248, 251, 252, 253, 254}
    assert (view.color[view.color[..., 3] > 0][:, :3] == [0, 255, 0]).all()


def test_distant_textures_show_their_mean() -> None:
    stripes = np.zeros((64, 64, 3), np.uint8)
    stripes[::2] = 255
    shape = dressed(Material("stripes", texture=Texture(TextureImage.of(stripes))))
    for mesh in shape.meshes:
        mesh.appearance.uv[:] *= 60.0
    (view,) = views_of(shape, **FLAT)
    shown = view.color[view.instances >= 0].astype(int)
    assert np.abs(shown - 188).mean() < 6, "half of white is 188 in sRGB; without levels it would flicker by 128"


def test_levels_end_in_one_texel_that_is_the_mean_weighted_by_alpha() -> None:
    leaf = np.zeros((3, 5, 4), np.uint8)
    leaf[:, :, :] = [0, 255, 0, 255]
    leaf[0] = 0
    look = mesh_look(
        [Appearance((Material("leaf", texture=Texture(TextureImage.of(leaf))),), np.zeros(1, np.int32))], [1]
    )
    assert look is not None
    assert look.levels[:, 1:].tolist() == [[5, 3], [3, 2], [2, 1], [1, 1]]
    red, green, blue, alpha = look.texels[-1].tolist()
    assert red == blue == 0.0
    assert green == alpha == pytest.approx(0.75), "the last row counts twice where a size is odd"


def test_pyrender_sees_the_same_texture() -> None:
    os.environ.setdefault("PYOPENGL_PLATFORM", "egl")
    import io

    import pyrender
    import trimesh

    from stages.package.glb import glb_bytes

    waves = 0.5 + 0.4 * np.cos(np.arange(64) * np.pi / 32)
    pixels = np.stack(np.broadcast_arrays(waves[:, None], waves[None], 0.5), axis=2)
    image = TextureImage.of(np.rint(255 * pixels).astype(np.uint8))
    shape = dressed(Material("colours", texture=Texture(image)))  # trimesh repeats all textures
    (view,) = views_of(shape, **FLAT)
    camera = view.camera
    scene = pyrender.Scene.from_trimesh_scene(
        trimesh.load_scene(io.BytesIO(glb_bytes(shape)), file_type="glb"), bg_color=(1.0, 1.0, 1.0, 1.0)
    )
    k, pose = np.array(camera["intrinsics"]), np.linalg.inv(np.array(camera["world_to_camera"]))
    pose[:3, 1:3] *= -1.0
    scene.add(pyrender.IntrinsicsCamera(k[0, 0], k[1, 1], k[0, 2], k[1, 2], znear=0.1, zfar=100.0), pose=pose)
    renderer = pyrender.OffscreenRenderer(camera["width"], camera["height"])
    flags = pyrender.RenderFlags.FLAT | pyrender.RenderFlags.SKIP_CULL_FACES
    theirs, depth = renderer.render(scene, flags=flags)
    renderer.delete()
    both = (depth > 0) & (view.instances >= 0)
    assert (depth > 0).sum() == pytest.approx(both.sum(), rel=0.01)
    difference = np.abs(view.color[both].astype(int) - theirs[both][:, :3])
    assert difference.mean() < 2.0
    assert np.quantile(difference.max(axis=1), 0.9) <= 3, "pyrender mixes neighbours at edges"
