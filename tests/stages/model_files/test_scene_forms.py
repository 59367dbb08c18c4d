"""glTF and DAE by the rules of their specifications."""

from __future__ import annotations

import base64
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline.errors import ConfigError
from stages.model_files.polygons import bridge_holes, triangulate
from stages.model_files.scene_file import read_scene
from tests.stages.exemplars.model_files import BOX_FACES, Glb, box, png
from tests.stages.model_files.measures import Measured, measured


def read_glb(folder: Path, glb: Glb) -> tuple[list[Measured], tuple[str, ...]]:
    scene = read_scene(glb.write(folder / "m.glb"))
    return measured(scene), scene.warnings


def skinned_glb(weights: np.ndarray, joints: np.ndarray, **more: Any) -> Glb:
    """Return a box on two joints: the first scaled to a hundredth and bound so, the second moved up by 1."""
    glb = Glb()
    inverse = np.stack([np.diag([100.0, 100.0, 100.0, 1.0]), np.eye(4)]).astype("<f4")
    matrices = glb.accessor(inverse.transpose(0, 2, 1).reshape(2, 16)[:, :4])
    glb.header["accessors"][matrices].update(type="MAT4", bufferView=glb.view(inverse.transpose(0, 2, 1).tobytes()))
    primitive = glb.primitive(box(), BOX_FACES)
    primitive["attributes"]["JOINTS_0"] = glb.accessor(joints)
    primitive["attributes"]["WEIGHTS_0"] = glb.accessor(weights, **more)
    bone = glb.node(root=False, name="bone")
    glb.node(name="armature", scale=[0.01] * 3, children=[bone])
    lift = glb.node(name="lift", translation=[0, 1, 0])
    glb.node(name="seat", mesh=glb.mesh(primitive), skin=0, translation=[7, 7, 7])
    glb.header["skins"] = [{"joints": [bone, lift], "inverseBindMatrices": matrices}]
    return glb


@pytest.mark.parametrize(("second", "low"), [(0, 0.0), (255, 1.0), (51, 0.2)])
def test_skin_moves_vertices_by_weighted_joints_and_not_by_its_node(tmp_path: Path, second: int, low: float) -> None:
    weights = np.tile(np.array([255 - second, second, 0, 0], "<u1"), (8, 1))
    joints = np.tile(np.array([0, 1, 0, 0], "<u1"), (8, 1))
    (part,), warnings = read_glb(tmp_path, skinned_glb(weights, joints, normalized=True))
    np.testing.assert_allclose(part.low, [0, low, 0], atol=1e-6)
    np.testing.assert_allclose(part.high, [1, low + 1, 1], atol=1e-6)
    assert warnings == ()


def test_vertices_without_weights_are_counted(tmp_path: Path) -> None:
    joints = np.zeros((8, 4), "<u1")
    (part,), (warning,) = read_glb(tmp_path, skinned_glb(np.zeros((8, 4), "<f4"), joints))
    assert part.volume == pytest.approx(1)
    assert "has 8 vertices without a joint of its skin" in warning


@pytest.mark.parametrize(("on_mesh", "on_node", "low"), [([1.0], None, 1), ([1.0], [0.5], 0.5), (None, None, 0)])
def test_morph_weights_of_the_node_go_before_those_of_the_mesh(
    tmp_path: Path, on_mesh: list[float] | None, on_node: list[float] | None, low: float
) -> None:
    glb = Glb()
    primitive = glb.primitive(box(), BOX_FACES)
    primitive["targets"] = [{"POSITION": glb.accessor(np.tile(np.array([0, 1, 0], "<f4"), (8, 1)))}]
    glb.node(mesh=glb.mesh(primitive), **({} if on_node is None else {"weights": on_node}))
    if on_mesh is not None:
        glb.header["meshes"][0]["weights"] = on_mesh
    assert read_glb(tmp_path, glb)[0][0].low.tolist() == [0, low, 0]


def test_hidden_nodes_are_left_out_with_what_is_below_them(tmp_path: Path) -> None:
    glb = Glb()
    mesh = glb.mesh(glb.primitive(box(), BOX_FACES))
    child = glb.node(root=False, name="child", mesh=mesh)
    glb.node(name="hidden", children=[child], extensions={"KHR_node_visibility": {"visible": False}})
    glb.node(name="shown", mesh=mesh, extensions={"KHR_node_visibility": {"visible": True}})
    parts, warnings = read_glb(tmp_path, glb)
    assert [part.name for part in parts] == ["shown"]
    assert warnings == ("1 hidden nodes are left out, with what is below them",)


@pytest.mark.parametrize(
    ("name", "is_read"),
    [
        ("KHR_materials_unlit", True),
        ("KHR_mesh_quantization", True),
        ("KHR_texture_transform", True),
        ("ACME_x", False),
    ],
)
def test_required_extension_is_read_or_named(tmp_path: Path, name: str, is_read: bool) -> None:
    glb = Glb()
    glb.node(mesh=glb.mesh(glb.primitive(box(), BOX_FACES)))
    glb.header["extensionsRequired"] = [name]
    if is_read:
        assert len(read_glb(tmp_path, glb)[0]) == 1
    else:
        with pytest.raises(ConfigError, match="requires the glTF extension 'ACME_x'"):
            read_glb(tmp_path, glb)


def striped_glb(uv: tuple[float, float], sampler: dict[str, int] | None) -> Glb:
    """Return a triangle with one texture coordinate: red at the left, green in the middle, blue at the right."""
    glb = Glb()
    pixels = np.tile(np.array([[255, 0, 0], [0, 255, 0], [0, 0, 255]]), (1, 1, 1))
    glb.header["images"] = [{"bufferView": glb.view(png(pixels))}]
    glb.header["textures"] = [{"source": 0, **({} if sampler is None else {"sampler": 0})}]
    glb.header["samplers"] = [sampler or {}]
    glb.header["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
    primitive = glb.primitive(box()[:3], np.array([[0, 1, 2]]), material=0)
    primitive["attributes"]["TEXCOORD_0"] = glb.accessor(np.tile(np.array(uv, "<f4"), (3, 1)))
    glb.node(mesh=glb.mesh(primitive))
    return glb


@pytest.mark.parametrize(
    ("u", "wrap", "color"),
    [
        (1.1, None, (255, 0, 0)),
        (1.1, 10497, (255, 0, 0)),
        (1.1, 33071, (0, 0, 255)),
        (1.1, 33648, (0, 0, 255)),
        (1.9, 33648, (255, 0, 0)),
        (-0.1, 33071, (255, 0, 0)),
        (-0.1, 33648, (255, 0, 0)),
        (0.5, 33648, (0, 255, 0)),
    ],
)
def test_sampler_says_what_is_beyond_a_texture(
    tmp_path: Path, u: float, wrap: int | None, color: tuple[int, ...]
) -> None:
    glb = striped_glb((u, 0.5), None if wrap is None else {"wrapS": wrap, "magFilter": 9728})
    assert read_glb(tmp_path, glb)[0][0].colors == [color]


def test_image_of_an_extension_falls_back_to_the_plain_one(tmp_path: Path) -> None:
    glb = striped_glb((0.1, 0.5), None)
    glb.header["images"].append({"bufferView": glb.view(b"no picture"), "mimeType": "image/ktx2"})
    glb.header["textures"][0]["extensions"] = {"KHR_texture_basisu": {"source": 1}}
    parts, warnings = read_glb(tmp_path, glb)
    assert parts[0].colors == [(255, 0, 0)]
    assert warnings == ()
    del glb.header["textures"][0]["source"]
    assert "image 1 (embedded) cannot be read" in read_glb(tmp_path, glb)[1][0]


def test_chunks_may_be_padded_with_nul_and_come_after_others(tmp_path: Path) -> None:
    glb = Glb()
    glb.node(mesh=glb.mesh(glb.primitive(box(), BOX_FACES)))
    text = json.dumps({**glb.header, "buffers": [{"byteLength": len(glb.chunk)}]}).encode()
    text += b"\0" * (8 - len(text) % 4)
    chunks = ((b"JSON", text), (b"ACME", b"abcd"), (b"BIN\0", glb.chunk))
    body = b"".join(struct.pack("<I4s", len(chunk), kind) + chunk for kind, chunk in chunks)
    (tmp_path / "m.glb").write_bytes(b"glTF" + struct.pack("<II", 2, 12 + len(body)) + body)
    assert measured(read_scene(tmp_path / "m.glb"))[0].volume == pytest.approx(1)


@pytest.mark.parametrize("is_base64", [True, False])
def test_buffer_may_be_a_data_uri_of_either_kind(tmp_path: Path, is_base64: bool) -> None:
    glb = Glb()
    glb.node(mesh=glb.mesh(glb.primitive(box(), BOX_FACES)))
    payload = base64.b64encode(glb.chunk).decode() if is_base64 else "".join(f"%{byte:02x}" for byte in glb.chunk)
    uri = f"data:application/octet-stream{';base64' if is_base64 else ''},{payload}"
    header = {**glb.header, "buffers": [{"byteLength": len(glb.chunk), "uri": uri}]}
    (tmp_path / "m.gltf").write_text(json.dumps(header), encoding="utf-8-sig")
    assert measured(read_scene(tmp_path / "m.gltf"))[0].volume == pytest.approx(1)


def test_buffer_that_is_a_pointer_is_named(tmp_path: Path) -> None:
    glb = Glb()
    glb.node(mesh=glb.mesh(glb.primitive(box(), BOX_FACES)))
    (tmp_path / "m.bin").write_bytes(b"version https://git-lfs.github.com/spec/v1\n")
    header = {**glb.header, "buffers": [{"byteLength": len(glb.chunk), "uri": "m.bin"}]}
    (tmp_path / "m.gltf").write_text(json.dumps(header), encoding="utf-8")
    with pytest.raises(ConfigError, match=r"m\.bin', is a Git LFS pointer"):
        read_scene(tmp_path / "m.gltf")


DAE = """<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><asset><unit meter="{unit}"/>
<up_axis>Z_UP</up_axis></asset><library_geometries><geometry id="g"><mesh><source id="p"><float_array id="a" count="24">
0 0 0 4 0 0 4 4 0 0 4 0 1 1 0 1 2 0 2 2 0 2 1 0</float_array><technique_common>
<accessor source="#a" count="8" stride="3">
<param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common>
</source><vertices id="v"><input semantic="POSITION" source="#p"/></vertices>{primitives}</mesh></geometry>
</library_geometries><library_visual_scenes><visual_scene id="s"><node id="n"><instance_geometry url="#g"/></node>
</visual_scene></library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>"""
INPUT = '<input semantic="VERTEX" source="#v" offset="0"/>'
QUAD = f"<polylist count='1'>{INPUT}<vcount>4</vcount><p>0 1 2 3</p></polylist>"
TRIANGLE = f"<triangles count='1'>{INPUT}<p>0 1 2</p></triangles>"


@pytest.mark.parametrize(
    ("primitives", "area", "warning"),
    [
        (f"<polygons>{INPUT}<ph><p>0 1 2 3</p><h>4 5 6 7</h></ph></polygons>", 15, ""),
        (f"<polygons>{INPUT}<p>4 7 6 5</p><ph><p>0 1 2 3</p><h>4 7 6 5</h></ph></polygons>", 16, ""),
        (
            f"<polygons>{INPUT}<p>0 1 2 3</p><ph><p>0 1 2 3</p><h>4 5 99 7</h></ph></polygons>",
            16,
            "polygon 0 with holes",
        ),
        (QUAD, 16, ""),
        (f"<trifans count='1'>{INPUT}<p>0 1 2 3</p></trifans>", 16, ""),
        (f"<tristrips count='1'>{INPUT}<p>0 1 3 2</p></tristrips>", 16, ""),
        (
            f"<spirals>{INPUT}<p>0 1</p></spirals>{QUAD}",
            16,
            "1 primitives <spirals> of geometry 'g' are unknown or invalid",
        ),
        (
            TRIANGLE.replace("#v", "#x") + TRIANGLE,
            8,
            "1 primitives <triangles> of geometry 'g'",
        ),
    ],
)
def test_primitives_of_dae(tmp_path: Path, primitives: str, area: float, warning: str) -> None:
    (tmp_path / "m.dae").write_text(DAE.format(unit=0.5, primitives=primitives), encoding="utf-8")
    scene = read_scene(tmp_path / "m.dae")
    assert (scene.up, scene.unit) == ("z", 1.0)
    assert measured(scene)[0].area == pytest.approx(area / 4)
    assert [text[: len(warning)] for text in scene.warnings] == ([warning] if warning else [])


@pytest.mark.parametrize("turns", range(6))
def test_two_sided_polygons_have_the_same_triangles_on_both_sides(turns: int) -> None:
    outline = np.array([[0, 0, 0], [4, 0, 0], [4, 4, 0], [2, 1, 0], [0, 4, 0], [0, 2, 0]], dtype=np.float64)
    front = list(range(6))
    back = np.roll(front[::-1], turns).tolist()
    corners = np.array([*front, *back, 0, 1, 2, 4, *np.roll([4, 2, 1, 0], turns)])
    triangles, polygon = triangulate(outline, corners, np.array([6, 6, 4, 4]))
    faces = [{tuple(sorted(face)) for face in corners[triangles[polygon == index]].tolist()} for index in range(4)]
    assert faces[0] == faces[1]
    assert faces[2] == faces[3]
    points = outline[corners[triangles]]
    normals = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])[:, 2]
    assert (normals[polygon % 2 == 0] > 0).all()
    assert (normals[polygon % 2 == 1] < 0).all()


def test_bridges_leave_all_holes_open() -> None:
    outline = np.array([[0, 0, 0], [9, 0, 0], [9, 9, 0], [0, 9, 0]], dtype=np.float64)
    square = np.array([[1, 1, 0], [2, 1, 0], [2, 2, 0], [1, 2, 0]], dtype=np.float64)
    holes = [square + np.array([3 * column, 3 * row, 0]) for column in range(3) for row in range(2)]
    points = np.concatenate([outline, *holes])
    ring = bridge_holes(outline, [hole[:: (-1) ** number] for number, hole in enumerate(holes)])
    points = np.concatenate([outline, *(hole[:: (-1) ** number] for number, hole in enumerate(holes))])
    triangles, _ = triangulate(points, ring, np.array([len(ring)]))
    spans = points[ring[triangles]]
    assert np.linalg.norm(np.cross(spans[:, 1] - spans[:, 0], spans[:, 2] - spans[:, 0]), axis=1).sum() / 2 == 81 - 6
