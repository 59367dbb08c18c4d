"""Normal textures, finish, occlusion and emission in lit colours, against normals of meshes, and pyrender."""

from __future__ import annotations

import io
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from stages.package.glb import glb_bytes
from stages.shape.appearance import Material, Texture, TextureImage, unit_vectors
from stages.shape.kit import Assembly
from stages.shape.shape import Shape, kit_shape
from stages.shape.views.camera import Camera
from stages.shape.views.palette import linear_to_srgb, srgb_to_linear
from stages.shape.views.portrait import portrait
from stages.shape.views.scene import mesh_set, scene_of
from tests.stages.shape.views.solids import cylinder, kit_of, part_type
from tests.stages.views.rendered import lopsided, views_of
from tests.stages.views.test_textures import CAMERAS, PIXELS, dressed

LIT: dict[str, Any] = {"cameras": CAMERAS, "width": 200, "height": 160, "images": ["color", "normals", "instances"]}
PAPER = Material("paper", texture=Texture(TextureImage.of(PIXELS)))


def plain(*numbers: int) -> Texture:
    """Return a texture of one colour."""
    return Texture(TextureImage.of(np.full((2, 2, 3), numbers, np.uint8)))


def lit(shape: Shape, **color: Any) -> Any:
    (view,) = views_of(shape, **LIT, color={"supersample": 1, **color})
    return view


def test_materials_without_maps_keep_their_pixels() -> None:
    assert np.array_equal(lit(dressed(replace(PAPER, roughness=0.2))).color, lit(dressed(PAPER)).color)


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
def test_a_normal_texture_bends_normals_to_the_right_and_upwards(projection: str) -> None:
    red, green, blue = 190, 90, 230
    bend = np.array([red, green, blue]) / 127.5 - 1.0
    keys = {**LIT, "cameras": [{**CAMERAS[0], "projection": projection}]}
    textured = dressed(replace(PAPER, normal_texture=plain(red, green, blue), normal_scale=1.5))
    normals = mesh_set(textured.meshes).corner_normals
    turned, first = [], 0
    for mesh in dressed(PAPER).meshes:
        look, corners = mesh.appearance, mesh.vertices[mesh.faces]
        own = normals[first : first + len(corners)].astype(float)
        first += len(corners)
        assert look is not None
        assert look.uv is not None
        bent = bend[2] * own
        for face in range(len(corners)):
            # where the first coordinate grows and the second does not, and where the second falls
            sides, ways = corners[face, 1:] - corners[face, 0], look.uv[face, 1:] - look.uv[face, 0]
            along = np.linalg.solve(ways.astype(float), sides)
            for way, amount in ((along[0], 1.5 * bend[0]), (-along[1], 1.5 * bend[1])):
                flat = way - (own[face] @ way)[:, None] * own[face]
                bent[face] += amount * flat / np.linalg.norm(flat, axis=1, keepdims=True)
        turned.append(replace(mesh, appearance=replace(look, normals=unit_vectors(bent))))
    (shown,), (expected,), (before,) = (
        views_of(shape, **keys, color={"supersample": 1, "shadows": False})
        for shape in (textured, replace(textured, meshes=tuple(turned)), dressed(PAPER))
    )
    boxes = np.isin(shown.instances, (0, 1, 3))  # on the drum, normals are bent after they are interpolated
    difference = np.abs(shown.color.astype(int) - expected.color).max(axis=2)[boxes]
    assert np.quantile(difference, 0.999) <= 1
    assert np.abs(shown.color.astype(int) - before.color).max(axis=2)[boxes].mean() > 10


def test_emission_is_added_in_linear_light() -> None:
    glow, black = (0.5, 0.2, 0.05), Material("black", (0.0, 0.0, 0.0, 1.0))
    shown = lit(dressed(replace(black, emissive=glow, emissive_texture=plain(255, 255, 188))))
    seen = shown.instances >= 0
    wanted = linear_to_srgb(np.array([0.5, 0.2, 0.05 * srgb_to_linear(np.uint8(188))]))
    assert (np.abs(shown.color[seen].astype(int) - wanted) <= 1).all()
    dim = replace(PAPER, base_color=(0.3, 0.3, 0.3, 1.0))
    added = srgb_to_linear(lit(dressed(replace(dim, emissive=(0.1, 0.1, 0.1)))).color) - srgb_to_linear(
        lit(dressed(dim)).color
    )
    np.testing.assert_allclose(added[seen], 0.1, atol=0.01)


@pytest.mark.parametrize("strength", [0.5, 1.0])
def test_occlusion_dims_the_sky(strength: float) -> None:
    texture = plain(51, 0, 0)
    gray = Material("gray", (0.8, 0.8, 0.8, 1.0), occlusion_texture=texture, occlusion_strength=strength)
    shown = lit(dressed(gray), light_elevation=-90.0, shadows=False)
    (world,) = views_of(lopsided(), **LIT, normals_space="world")
    upwards = world.normals[:, :, 1] > 0.999
    wanted = linear_to_srgb(np.full(3, 0.8 * 0.40 * (1.0 + strength * (0.2 - 1.0))))
    assert upwards.sum() > 1000
    assert (np.abs(shown.color[upwards].astype(int) - wanted) <= 1).all()


def test_portraits_show_emission_and_bent_normals() -> None:
    camera, size = Camera(-40.0, 25.0), (120, 120)
    before, glowing, bent = (
        portrait(scene_of(dressed(material)), camera, size).astype(int)
        for material in (
            PAPER,
            replace(PAPER, emissive=(0.2, 0.2, 0.2)),
            replace(PAPER, normal_texture=plain(220, 128, 200)),
        )
    )
    assert (glowing >= before).all()
    assert (glowing - before).mean() > 10
    assert np.abs(bent - before).max() > 20


def column() -> Shape:
    """Return a column that stands upright."""
    kit = kit_of(part_type("column", cylinder(180, 0.6, 2.0), (255, 255, 255)))
    return kit_shape(kit, Assembly(np.zeros(1, np.int16), np.eye(4)[None], np.empty((0, 2), np.int32)))


@pytest.mark.parametrize("roughness", [0.6, 0.8])
def test_metal_reflects_the_lamp_as_in_pyrender(roughness: float) -> None:
    import trimesh
    from scipy.ndimage import minimum_filter

    from stages.shape.views.opengl import load_pyrender
    from stages.views.cameras import cosine_and_sine, orbit_rotation
    from tests.renderings.peers import camera_pose

    pyrender = load_pyrender()
    azimuth, elevation = 10.0, -10.0
    shape = dressed(Material("gold", (0.5, 0.35, 0.15, 1.0), metallic=1.0, roughness=roughness), column())
    view = lit(shape, light_azimuth=azimuth, light_elevation=elevation, shadows=False)
    without = lit(shape, light_azimuth=azimuth, light_elevation=-90.0, shadows=False)
    scene = pyrender.Scene.from_trimesh_scene(
        trimesh.load_scene(io.BytesIO(glb_bytes(shape)), file_type="glb"), ambient_light=np.zeros(3)
    )
    k = np.array(view.camera["intrinsics"])
    lens = pyrender.IntrinsicsCamera(k[0, 0], k[1, 1], k[0, 2], k[1, 2], znear=0.1, zfar=100.0)
    scene.add(lens, pose=camera_pose(view.camera))
    lamp = np.eye(4)
    lamp[:3, :3] = orbit_rotation(azimuth, cosine_and_sine(elevation)[1]).T
    scene.add(pyrender.DirectionalLight(intensity=0.7 * np.pi), pose=lamp)
    renderer = pyrender.OffscreenRenderer(view.camera["width"], view.camera["height"])
    theirs, depth = renderer.render(scene, flags=pyrender.RenderFlags.SKIP_CULL_FACES)
    renderer.delete()
    inner = minimum_filter((view.instances >= 0) & (depth > 0), 5)
    shine = (srgb_to_linear(view.color) - srgb_to_linear(without.color))[inner]
    expected = srgb_to_linear(theirs[:, :, :3].copy())[inner]
    assert expected.max() > 0.2
    assert np.corrcoef(shine.ravel(), expected.ravel())[0, 1] > 0.99
    assert np.quantile(np.abs(shine - expected), 0.99) < 0.1 * expected.max(), "pyrender mixes pixels at edges"
