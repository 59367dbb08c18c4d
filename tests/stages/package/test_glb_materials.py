"""Materials and textures in a GLB, as trimesh, Open3D, pyrender and Hugging Face `datasets` load them."""

from __future__ import annotations

import io
import json
import struct
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from stages.package.glb import glb_bytes
from stages.package.glb_shape import glb_shape
from stages.shape.appearance import NO_MATERIAL, Appearance, Material, Texture, TextureImage, given_normals
from stages.shape.geometry.pose import transform_points
from stages.shape.shape import Shape, kit_shape
from tests.stages.package.toy import chain, toy_kit

GRID = np.zeros((4, 4, 3), np.uint8)
GRID[::2, ::2], GRID[1::2, 1::2] = (255, 0, 0), (0, 0, 255)
GRASS = np.random.default_rng(1).integers(0, 255, (6, 6, 3)).astype(np.uint8).repeat(20, axis=0).repeat(20, axis=1)
LEAF = np.full((4, 4, 4), 200, np.uint8)
LEAF[0, :, 3] = 0
TILES = Material("tiles", texture=Texture(TextureImage.of(GRID), "mirror", "clamp", True), roughness=0.5)
GLASS = Material("glass", (0.25, 0.5, 1.0, 0.25), alpha_mode="blend", double_sided=True, emissive=(0.5, 0.0, 0.0))
LEAVES = Material("leaves", texture=Texture(TextureImage.of(LEAF)), alpha_mode="mask", alpha_cutoff=0.75)


def textured(materials: tuple[Material, ...] = (TILES, GLASS, LEAVES)) -> Shape:
    """Return a shape whose faces take the materials and none in turn, with planar coordinates."""
    shape = kit_shape(toy_kit("blocks"), chain(4, 0))
    meshes = []
    for mesh in shape.meshes:
        corners = mesh.vertices[mesh.faces]
        number = np.arange(len(corners), dtype=np.int32) % (len(materials) + 1) - 1
        normals = given_normals(corners, np.zeros_like(corners))
        look = Appearance(materials, number, corners[:, :, :2].astype(np.float32), normals)
        meshes.append(replace(mesh, appearance=look))
    return replace(shape, meshes=tuple(meshes))


def header_of(content: bytes) -> dict[str, Any]:
    length = struct.unpack("<I", content[12:16])[0]
    header: dict[str, Any] = json.loads(content[20 : 20 + length])
    return header


def loaded(content: bytes, **options: Any) -> Any:
    import trimesh

    return trimesh.load_scene(io.BytesIO(content), file_type="glb", process=False, **options)


def test_a_material_is_one_primitive_and_images_are_shared() -> None:
    header = header_of(glb_bytes(textured()))
    assert [material["name"] for material in header["materials"]] == ["tiles", "glass", "leaves"]
    assert [len(mesh["primitives"]) for mesh in header["meshes"]] == [4, 4]
    assert len(header["images"]) == len(header["textures"]) == 2
    assert header["samplers"][0] == {"magFilter": 9728, "minFilter": 9987, "wrapS": 33648, "wrapT": 33071}
    tiles, glass, leaves = header["materials"]
    assert tiles["pbrMetallicRoughness"]["baseColorTexture"] == {"index": 0}
    assert glass["alphaMode"] == "BLEND"
    assert glass["doubleSided"] is True
    assert glass["emissiveFactor"] == [0.5, 0.0, 0.0]
    assert (leaves["alphaMode"], leaves["alphaCutoff"]) == ("MASK", 0.75)
    for mesh in header["meshes"]:
        for primitive in mesh["primitives"]:
            names = set(primitive["attributes"])
            assert ("COLOR_0" in names) == ("material" not in primitive), (
                "loaders drop colours of faces with a material"
            )
            assert ("TEXCOORD_0" in names) == (primitive.get("material") in (0, 2))
            assert "NORMAL" in names


def test_views_are_aligned_and_lie_inside() -> None:
    header = header_of(glb_bytes(textured()))
    ends = [view["byteOffset"] + view["byteLength"] for view in header["bufferViews"]]
    assert all(view["byteOffset"] % 4 == 0 for view in header["bufferViews"])
    assert max(ends) <= header["buffers"][0]["byteLength"]
    for image in header["images"]:
        assert "target" not in header["bufferViews"][image["bufferView"]]


def test_trimesh_loads_names_textures_and_coordinates() -> None:
    shape = textured((TILES,))
    scene = loaded(glb_bytes(shape))
    seen = 0
    for mesh in shape.meshes:
        for geometry in scene.geometry.values():
            if geometry.visual.kind != "texture" or not np.isin(geometry.vertices[0], mesh.vertices).all():
                continue
            assert geometry.visual.material.name == "tiles"
            np.testing.assert_array_equal(np.asarray(geometry.visual.material.baseColorTexture), GRID)
            uv = geometry.visual.uv * (1, -1) + (0, 1)  # trimesh has the origin at the lower left
            np.testing.assert_allclose(uv, geometry.vertices[:, :2], atol=1e-6)
            seen += 1
    assert seen >= 2


def test_trimesh_puts_all_primitives_of_a_part_at_its_node() -> None:
    shape = textured()
    scene = loaded(glb_bytes(shape))
    for part, name in enumerate(shape.part_names):
        below = [scene.graph.get(node) for node in scene.graph.transforms.children[name]]
        pose, _ = scene.graph.get(name)
        mesh = shape.meshes[shape.assembly.types[part]]
        assert mesh.appearance is not None
        order = np.argsort(mesh.appearance.face_material, kind="stable")
        stored = np.concatenate([scene.geometry[geometry].triangles for _, geometry in below])
        assert all(np.array_equal(matrix, pose) for matrix, _ in below)
        stored = transform_points(pose, stored.reshape(-1, 3)).reshape(-1, 3, 3)
        expected = transform_points(shape.assembly.poses[part], mesh.vertices)[mesh.faces[order]]
        np.testing.assert_allclose(stored, expected, atol=1e-6)


def test_open3d_and_pyrender_show_the_texture(tmp_path: Path) -> None:
    import open3d as o3d
    import pyrender

    content = glb_bytes(textured((TILES,)))
    (tmp_path / "shape.glb").write_bytes(content)
    model = o3d.io.read_triangle_model(str(tmp_path / "shape.glb"))
    albedo = [np.asarray(material.albedo_img)[:, :, :3] for material in model.materials if material.albedo_img]
    assert any(np.array_equal(image, GRID) for image in albedo)
    scene = pyrender.Scene.from_trimesh_scene(loaded(content))
    materials = [primitive.material for mesh in scene.meshes for primitive in mesh.primitives]
    textures = [material.baseColorTexture for material in materials if material.baseColorTexture is not None]
    assert textures
    np.testing.assert_array_equal(np.asarray(textures[0].source)[:, :, :3], GRID)


def test_hugging_face_shows_the_texture() -> None:
    from datasets import Dataset, Features, Mesh

    content = glb_bytes(textured((TILES,)))
    rows = Dataset.from_list([{"mesh": {"bytes": content, "path": "shape.glb"}}], Features({"mesh": Mesh()}))
    mesh = rows[0]["mesh"]
    images = [geometry.visual.material.baseColorTexture for geometry in getattr(mesh, "geometry", {"": mesh}).values()
              if geometry.visual.kind == "texture"]  # fmt: skip
    assert images
    np.testing.assert_array_equal(np.asarray(images[0]), GRID)


def materials_of(look: Appearance) -> list[Material | None]:
    return [None if number == NO_MATERIAL else look.materials[number] for number in look.face_material.tolist()]


def test_the_look_that_is_read_back_is_the_one_that_was_written() -> None:
    shape = textured()
    read = glb_shape(glb_bytes(shape))
    assert read.part_names == shape.part_names
    for part in range(len(shape)):
        before, after = (item.meshes[item.assembly.types[part]] for item in (shape, read))
        assert before.appearance is not None
        assert after.appearance is not None
        order = np.argsort(before.appearance.face_material, kind="stable")
        look = before.appearance.select(order)
        assert materials_of(after.appearance) == materials_of(look)
        np.testing.assert_allclose(after.vertices[after.faces], before.vertices[before.faces[order]], atol=1e-6)
        np.testing.assert_allclose(after.appearance.normals, look.normals, atol=1e-6)
        has_texture = np.isin(look.face_material, (0, 2))
        assert after.appearance.uv is not None
        assert look.uv is not None
        np.testing.assert_allclose(after.appearance.uv[has_texture], look.uv[has_texture], atol=1e-6)


def test_photos_are_jpegs_and_palettes_and_cutouts_are_pngs() -> None:
    smooth = np.random.default_rng(0).normal(0, 12, (128, 128, 3)).cumsum(axis=0).cumsum(axis=1)
    photo = TextureImage.of(np.clip(128 + smooth / 8, 0, 255).astype(np.uint8))
    palette, cutout = TextureImage.of(GRID), TextureImage.of(LEAF)
    for image, kind in ((photo, "image/jpeg"), (palette, "image/png"), (cutout, "image/png")):
        header = header_of(glb_bytes(textured((replace(TILES, texture=Texture(image)),))))
        assert [entry["mimeType"] for entry in header["images"]] == [kind]


def test_equal_shapes_give_equal_bytes() -> None:
    assert glb_bytes(textured()) == glb_bytes(textured())


@pytest.mark.parametrize("pixels", [GRID, LEAF, GRASS])
def test_png_textures_lose_nothing(pixels: np.ndarray) -> None:
    content = glb_bytes(textured((replace(TILES, texture=Texture(TextureImage.of(pixels))),)))
    header = header_of(content)
    view = header["bufferViews"][header["images"][0]["bufferView"]]
    start = len(content) - header["buffers"][0]["byteLength"] + view["byteOffset"]
    if header["images"][0]["mimeType"] == "image/png":
        stored = Image.open(io.BytesIO(content[start : start + view["byteLength"]]))
        np.testing.assert_array_equal(np.asarray(stored), pixels)
