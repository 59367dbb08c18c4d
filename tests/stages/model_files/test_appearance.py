"""The same textured square in GLB, OBJ and DAE has the same look."""

from __future__ import annotations

import io
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from stages.model_files.kept_appearance import shrunk
from stages.model_files.read import read_model
from stages.model_files.scene import ModelScene
from stages.package.glb import glb_bytes
from stages.shape.appearance import (
    Appearance,
    Material,
    Texture,
    TextureImage,
    describe_materials,
    restore_materials,
)
from stages.shape.kit import Assembly, PartMesh
from stages.shape.shape import Shape

PIXELS = np.array([[[250, 10, 20], [0, 200, 0]], [[0, 0, 255], [90, 90, 90]]], np.uint8)
CORNERS = np.array([[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]], float)
UV = np.array([[0, 1], [3, 1], [3, 0], [0, 0]], float)
"""With the origin at the upper left."""
NORMALS = np.array([[0, 0, 1], [0, 0, 1], [0, 0.6, 0.8], [0, 0.6, 0.8]], float)
FACES = np.array([[0, 1, 2], [0, 2, 3]])


def png(pixels: np.ndarray = PIXELS) -> bytes:
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, "PNG")
    return stream.getvalue()


def glb(folder: Path) -> Path:
    """Write the square with trimesh."""
    import trimesh

    material = trimesh.visual.material.PBRMaterial(
        name="tiles",
        baseColorTexture=Image.fromarray(PIXELS),
        metallicFactor=0.0,
        roughnessFactor=0.5,
        alphaMode="MASK",
        alphaCutoff=0.25,
        doubleSided=True,
    )
    visual = trimesh.visual.TextureVisuals(uv=UV * (1, -1) + (0, 1), material=material)
    mesh = trimesh.Trimesh(CORNERS, FACES, vertex_normals=NORMALS, visual=visual, process=False)
    path = folder / "square.glb"
    path.write_bytes(trimesh.Scene({"square": mesh}).export(file_type="glb"))
    return path


def obj(folder: Path) -> Path:
    (folder / "tiles.png").write_bytes(png())
    (folder / "square.mtl").write_text(
        "newmtl tiles\nKd 0.1 0.1 0.1\nNs 6\nmap_Kd tiles.png\nmap_Bump bumps.png\n", encoding="utf-8"
    )
    rows = [f"v {x} {y} {z}" for x, y, z in CORNERS]
    rows += [f"vt {u} {1 - v}" for u, v in UV] + [f"vn {x} {y} {z}" for x, y, z in NORMALS]
    (folder / "square.obj").write_text(
        "\n".join(["mtllib square.mtl", *rows, "usemtl tiles", "f 1/1/1 2/2/2 3/3/3", "f 1/1/1 3/3/3 4/4/4"]),
        encoding="utf-8",
    )
    return folder / "square.obj"


def dae(folder: Path) -> Path:
    (folder / "tiles.png").write_bytes(png())

    def source(name: str, rows: np.ndarray, axes: str) -> str:
        params = "".join(f'<param name="{axis}" type="float"/>' for axis in axes)
        return (
            f'<source id="{name}"><float_array id="{name}-a" count="{rows.size}">{" ".join(map(str, rows.ravel()))}'
            f'</float_array><technique_common><accessor source="#{name}-a" count="{len(rows)}" stride="{len(axes)}">'
            f"{params}</accessor></technique_common></source>"
        )

    index = " ".join(f"{corner} {corner} {corner}" for corner in FACES.ravel())
    (folder / "square.dae").write_text(
        f"""<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><asset><up_axis>Y_UP</up_axis></asset>
<library_images><image id="img"><init_from>tiles.png</init_from></image></library_images>
<library_effects><effect id="fx"><profile_COMMON>
<newparam sid="surf"><surface type="2D"><init_from>img</init_from></surface></newparam>
<newparam sid="samp"><sampler2D><source>surf</source></sampler2D></newparam>
<technique sid="t"><lambert><diffuse><texture texture="samp" texcoord="UV"/></diffuse></lambert></technique>
</profile_COMMON></effect></library_effects>
<library_materials><material id="mat" name="tiles"><instance_effect url="#fx"/></material></library_materials>
<library_geometries><geometry id="g" name="square"><mesh>{source("p", CORNERS, "XYZ")}{source("n", NORMALS, "XYZ")}
{source("t", UV * (1, -1) + (0, 1), "ST")}<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="2" material="m"><input semantic="VERTEX" source="#v" offset="0"/>
<input semantic="NORMAL" source="#n" offset="1"/><input semantic="TEXCOORD" source="#t" offset="2" set="0"/>
<p>{index}</p></triangles></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node id="square"><instance_geometry url="#g"><bind_material>
<technique_common><instance_material symbol="m" target="#mat"/></technique_common></bind_material></instance_geometry>
</node></visual_scene></library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>""",
        encoding="utf-8",
    )
    return folder / "square.dae"


FORMATS = {"glb": glb, "obj": obj, "dae": dae}


@pytest.mark.parametrize("name", FORMATS)
def test_a_textured_square_has_its_material_pixels_coordinates_and_normals(name: str, tmp_path: Path) -> None:
    (surface,) = read_model(FORMATS[name](tmp_path), texture_size=512).surfaces
    look = surface.appearance
    assert look is not None
    assert look.uv is not None
    assert look.normals is not None
    (material,) = (look.materials[number] for number in np.unique(look.face_material))
    assert material.name == "tiles"
    assert material.base_color == (1.0, 1.0, 1.0, 1.0)
    assert material.texture is not None
    np.testing.assert_array_equal(material.texture.image.pixels, PIXELS)
    assert material.double_sided
    at = [[CORNERS.tolist().index(corner) for corner in face] for face in surface.vertices[surface.faces].tolist()]
    np.testing.assert_allclose(look.uv, UV[at], atol=1e-6)
    np.testing.assert_allclose(look.normals, NORMALS[at], atol=1e-6)


def test_sampler_and_invisible_material_of_a_dae(tmp_path: Path) -> None:
    text = dae(tmp_path).read_text(encoding="utf-8")
    sampler = "<wrap_s>MIRROR</wrap_s><wrap_t>CLAMP</wrap_t><magfilter>NEAREST</magfilter></sampler2D>"
    text = text.replace("</sampler2D>", sampler)
    text = text.replace("</diffuse>", "</diffuse><transparency><float>0</float></transparency>")
    (tmp_path / "square.dae").write_text(text, encoding="utf-8")
    scene = read_model(tmp_path / "square.dae", texture_size=512)
    assert scene.warnings == ("material 'tiles' is stated to be invisible; it is taken for opaque",)
    assert scene.surfaces[0].appearance is not None
    (material,) = scene.surfaces[0].appearance.materials
    texture = material.texture
    assert texture is not None
    assert (texture.wrap_u, texture.wrap_v, texture.nearest) == ("mirror", "clamp", True)
    assert (material.base_color[3], material.alpha_mode) == (1.0, "opaque")


def test_numbers_of_a_gltf_material_are_kept(tmp_path: Path) -> None:
    (surface,) = read_model(glb(tmp_path), texture_size=512).surfaces
    assert surface.appearance is not None
    material = surface.appearance.materials[0]
    assert (material.metallic, material.roughness) == (0.0, 0.5)
    assert (material.alpha_mode, material.alpha_cutoff) == ("mask", 0.25)


def shade(level: int) -> Texture:
    """Return a texture of one grey, which no other map has."""
    return Texture(TextureImage.of(np.full((2, 2, 3), level, np.uint8)))


def with_every_map() -> Material:
    return Material(
        "all",
        texture=shade(10),
        metallic=0.5,
        roughness=0.25,
        emissive=(1.0, 0.5, 0.25),
        metallic_roughness_texture=shade(20),
        normal_texture=shade(30),
        normal_scale=0.5,
        occlusion_texture=shade(40),
        occlusion_strength=0.25,
        emissive_texture=shade(50),
    )


@pytest.mark.parametrize("without", ["", "texture"])
def test_every_map_of_a_gltf_material_goes_through_reader_kit_and_file(without: str, tmp_path: Path) -> None:
    material = replace(with_every_map(), texture=None) if without else with_every_map()
    look = Appearance((material,), np.zeros(2, np.int32), UV[FACES].astype(np.float32), None)
    part = PartMesh(
        "square", CORNERS.astype(float), FACES.astype(np.int32), np.full((2, 3), 9, np.uint8), appearance=look
    )
    alone = Assembly(np.zeros(1, np.int16), np.eye(4)[None], np.empty((0, 2), np.int32))
    (tmp_path / "all.glb").write_bytes(glb_bytes(Shape((part,), alone, "y", ("square",))))
    scene = read_model(tmp_path / "all.glb", texture_size=512)
    assert scene.warnings == ()
    read = scene.surfaces[0].appearance
    assert read is not None
    assert read.uv is not None
    assert read.materials == (material,)
    assert sorted(map(tuple, read.uv.reshape(-1, 2).tolist())) == sorted(map(tuple, look.uv.reshape(-1, 2).tolist()))
    described, images = describe_materials(read.materials)
    assert restore_materials(json.loads(json.dumps(described)), images) == (material,)


def test_a_map_at_other_coordinates_or_without_an_image_is_named(tmp_path: Path) -> None:
    path = glb(tmp_path)
    content = path.read_bytes()
    length = int.from_bytes(content[12:16], "little")
    header = json.loads(content[20 : 20 + length])
    header["images"].append({"uri": "missing.png"})
    header["textures"].append({"source": len(header["images"]) - 1})
    header["materials"][0] |= {"normalTexture": {"index": 0, "texCoord": 1}, "emissiveTexture": {"index": 1}}
    edited = json.dumps(header).encode()
    edited += b" " * (-len(edited) % 4)
    chunks = len(edited).to_bytes(4, "little") + b"JSON" + edited + content[20 + length :]
    path.write_bytes(content[:8] + (12 + len(chunks)).to_bytes(4, "little") + chunks)
    scene = read_model(path, texture_size=512)
    assert scene.warnings == ("material 'tiles': normalTexture, emissiveTexture is not kept",)
    assert scene.surfaces[0].appearance is not None
    assert list(scene.surfaces[0].appearance.materials[0].textures) == ["texture"]


def test_maps_of_an_obj_are_kept_where_they_are_placed_as_its_texture(tmp_path: Path) -> None:
    path = obj(tmp_path)
    Image.fromarray(np.full((2, 2, 3), 128, np.uint8)).save(tmp_path / "bumps.png")
    library = tmp_path / "square.mtl"
    maps = "norm bumps.png\nmap_Ke bumps.png\nnewmtl spare\nnorm bumps.png\n"
    library.write_text(library.read_text(encoding="utf-8").replace("map_Bump bumps.png\n", maps), encoding="utf-8")
    scene = read_model(path, texture_size=512)
    assert scene.warnings == ("material 'spare': norm is not kept",)
    assert scene.surfaces[0].appearance is not None
    material = scene.surfaces[0].appearance.materials[0]
    assert list(material.textures) == ["texture", "normal_texture", "emissive_texture"]
    assert material.emissive == (1.0, 1.0, 1.0)


def test_an_obj_says_what_it_does_not_keep(tmp_path: Path) -> None:
    scene = read_model(obj(tmp_path), texture_size=512)
    assert scene.warnings == ("material 'tiles': map_bump is not kept",)
    assert scene.surfaces[0].appearance is not None
    assert scene.surfaces[0].appearance.materials[0].roughness == 0.5


def test_colors_alone_say_that_textures_are_lost(tmp_path: Path) -> None:
    scene = read_model(obj(tmp_path))
    assert scene.surfaces[0].appearance is None
    (warning,) = scene.warnings
    assert warning.startswith("1 texture is read as opaque colours of faces; `appearance: textures` keeps")


def painted(folder: Path, stated: str) -> ModelScene:
    """Read a triangle with vertex colours and a material."""
    (folder / "m.mtl").write_text(f"newmtl glass\n{stated}\n", encoding="utf-8")
    (folder / "m.obj").write_text(
        "mtllib m.mtl\nv 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 0 1 0 1 0 0\nusemtl glass\nf 1 2 3\n", encoding="utf-8"
    )
    return read_model(folder / "m.obj", texture_size=64)


def test_vertex_colors_stay_without_the_material_beside_them(tmp_path: Path) -> None:
    scene = painted(tmp_path, "Kd 0 0 1")
    assert scene.surfaces[0].appearance is None
    assert scene.surfaces[0].face_colors.tolist() == [[255, 0, 0]]
    assert scene.warnings == ("material 'glass': faces with vertex colours have these alone",)


@pytest.mark.parametrize(
    ("stated", "alpha"), [("d 0.25", 0.25), ("Tr 0.25", 0.75), ("d 0.5\nTr 0.25", 0.5), ("d 0", 1)]
)
def test_opacity_of_an_obj(stated: str, alpha: float, tmp_path: Path) -> None:
    (tmp_path / "m.mtl").write_text(f"newmtl glass\nKd 0 0 1\n{stated}\n", encoding="utf-8")
    (tmp_path / "m.obj").write_text(
        "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl glass\nf 1 2 3\n", encoding="utf-8"
    )
    look = read_model(tmp_path / "m.obj", texture_size=64).surfaces[0].appearance
    assert look is not None
    assert look.materials[0].base_color == (0.0, 0.0, 1.0, alpha)
    assert look.materials[0].alpha_mode == ("opaque" if alpha == 1 else "blend")


def test_large_textures_are_reduced_in_linear_light() -> None:
    stripes = np.zeros((4, 64, 3), np.uint8)
    stripes[:, ::2] = 255
    small = shrunk(stripes, 32)
    assert small.shape == (2, 32, 3)
    assert (small == 188).all(), "half of white is 188 in sRGB"
    assert shrunk(stripes, 64) is stripes


def test_numbers_of_a_reduced_map_are_means() -> None:
    stripes = np.zeros((4, 64, 3), np.uint8)
    stripes[:, ::2] = 200
    assert (shrunk(stripes, 32, is_color=False) == 100).all()


def test_what_is_transparent_does_not_darken_a_reduced_texture() -> None:
    leaf = np.zeros((2, 2, 4), np.uint8)
    leaf[0] = [40, 200, 30, 255]
    assert shrunk(leaf, 1).tolist() == [[[40, 200, 30, 128]]]
