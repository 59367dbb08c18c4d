"""GLB files, read back with trimesh."""

from __future__ import annotations

import io
import json
import struct

import numpy as np
import pytest

from stages.package.glb import glb_bytes, linear_colors
from stages.package.glb_shape import glb_shape
from stages.shape.geometry.pose import transform_points
from stages.shape.kit import Assembly, PartType
from stages.shape.shape import Shape, kit_shape
from tests.stages.package.toy import BOX, BOX_FACES, chain, toy_kit


def loaded(content: bytes):
    import trimesh

    return trimesh.load(io.BytesIO(content), file_type="glb", process=False)


def header_of(content: bytes) -> dict:
    length = struct.unpack("<I", content[12:16])[0]
    return json.loads(content[20 : 20 + length])


def turned_chain() -> Assembly:
    assembly = chain(5, 1)
    angle = 0.3
    turn = np.eye(4)
    turn[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    turn[:3, 3] = [1.5, -2.25, 1 / 3]
    return Assembly(assembly.types, turn @ assembly.poses, assembly.edges)


def test_every_part_is_a_node_named_by_type_with_the_triangles_of_its_type_in_its_place() -> None:
    kit, assembly = toy_kit("blocks"), turned_chain()
    scene = loaded(glb_bytes(kit_shape(kit, assembly)))
    names = kit_shape(kit, assembly).part_names
    assert names == ("long.wall.000", "tower.000", "long.wall.001", "tower.001", "long.wall.002")
    assert sorted(scene.graph.nodes_geometry) == sorted(names)
    for part, name in enumerate(names):
        pose, geometry = scene.graph.get(name)
        part_type = kit.types[assembly.types[part]]
        mesh = scene.geometry[geometry]
        triangles = transform_points(pose, mesh.vertices)[mesh.faces]
        expected = transform_points(assembly.poses[part], part_type.vertices)[part_type.faces]
        assert np.abs(triangles - expected).max() < 1e-6
        assert np.array_equal(pose, assembly.poses[part])


def test_equal_parts_share_one_mesh_and_types_not_in_use_are_left_out() -> None:
    kit = toy_kit("blocks")
    assert len(header_of(glb_bytes(kit_shape(kit, chain(6, 0))))["meshes"]) == 2
    only = header_of(glb_bytes(kit_shape(kit, chain(1, 1))))
    assert [mesh["name"] for mesh in only["meshes"]] == ["long.wall"]
    assert only["nodes"][0]["extras"] == {"class": 1, "instance": 0}


def test_every_face_keeps_its_colour_in_linear_light() -> None:
    kit = toy_kit("blocks")
    scene = loaded(glb_bytes(kit_shape(kit, chain(2, 0))))
    for part_type in kit.types:
        mesh = scene.geometry[part_type.name]
        corners = np.asarray(mesh.visual.vertex_colors)[mesh.faces]
        assert (corners == corners[:, :1]).all()
        assert np.array_equal(corners[:, 0], linear_colors(part_type.face_colors))


def test_linear_colours_follow_the_srgb_curve() -> None:
    linear = linear_colors(np.array([[0, 255, 188], [10, 64, 128]], dtype=np.uint8))
    assert linear.tolist() == [[0, 255, 128, 255], [1, 13, 55, 255]]


def test_the_container_is_aligned_and_its_arrays_lie_inside() -> None:
    content = glb_bytes(kit_shape(toy_kit("blocks"), turned_chain()))
    magic, version, length = struct.unpack("<4sII", content[:12])
    assert (magic, version, length) == (b"glTF", 2, len(content))
    header = header_of(content)
    assert header["buffers"][0]["byteLength"] % 4 == 0
    for view in header["bufferViews"]:
        assert view["byteOffset"] % 4 == 0
        assert view["byteOffset"] + view["byteLength"] <= header["buffers"][0]["byteLength"]
    for mesh in header["meshes"]:
        position = header["accessors"][mesh["primitives"][0]["attributes"]["POSITION"]]
        assert len(position["min"]) == len(position["max"]) == 3


@pytest.mark.parametrize(("colors", "vertices"), [(1, 8), (2, 8 + 4)])
def test_a_vertex_stands_once_for_every_colour_around_it(colors: int, vertices: int) -> None:
    face_colors = np.full((12, 3), 90, dtype=np.uint8)
    face_colors[10:] += colors - 1
    part_type = PartType("box", BOX, BOX_FACES, face_colors, np.eye(4), np.eye(4)[None])
    scene = loaded(glb_bytes(Shape((part_type,), chain(1, 0), "y", (part_type.name,))))
    assert len(scene.geometry["box"].vertices) == vertices


def test_a_type_of_more_than_65535_vertices_has_wide_indices() -> None:
    count = 30_000
    vertices = np.random.default_rng(0).random((3 * count, 3))
    faces = np.arange(3 * count, dtype=np.int32).reshape(-1, 3)
    part_type = PartType("dust", vertices, faces, np.zeros((count, 3), dtype=np.uint8), np.eye(4), np.eye(4)[None])
    mesh = loaded(glb_bytes(Shape((part_type,), chain(1, 0), "y", (part_type.name,)))).geometry["dust"]
    assert np.abs(mesh.vertices[mesh.faces] - vertices[faces]).max() < 1e-6


def test_the_same_assembly_gives_the_same_bytes() -> None:
    kit = toy_kit("planks")
    assert glb_bytes(kit_shape(kit, turned_chain())) == glb_bytes(kit_shape(kit, turned_chain()))


def test_the_shape_in_a_glb_is_the_one_that_was_written() -> None:
    shape = kit_shape(toy_kit("blocks"), turned_chain())
    read = glb_shape(glb_bytes(shape))
    assert sorted(read.part_names) == sorted(shape.part_names)
    assert set(read.labels) == {"tower", "long.wall"}
    for part, name in enumerate(shape.part_names):
        found = read.part_names.index(name)
        mesh, written = (item.meshes[item.assembly.types[at]] for item, at in ((read, found), (shape, part)))
        assert mesh.name == written.name
        np.testing.assert_allclose(mesh.face_colors.astype(int), written.face_colors, atol=2)
        triangles = transform_points(read.assembly.poses[found], mesh.vertices)[mesh.faces]
        expected = transform_points(shape.assembly.poses[part], written.vertices)[written.faces]
        np.testing.assert_allclose(triangles, expected, atol=1e-6)
