"""Readers of every format: parts, names, colours, and refusals with the remedy."""

from __future__ import annotations

import contextlib
import json
import os
import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pipeline.errors import ConfigError
from stages.exemplars import segmentation
from stages.exemplars.model import Model, RawPart
from stages.exemplars.read import parse_parts, read_parts
from stages.model_files.limits import ReadLimits
from tests.stages.exemplars.model_files import (
    BOX_FACES,
    Glb,
    box,
    png,
    signed_volume,
    textured_dae,
    textured_glb,
    world_triangles,
    write_obj,
)

EXEMPLARS = Path(__file__).resolve().parents[4] / "shared" / "exemplars"

BOXES = {
    "base": box((4, 1, 4)),
    "tower": box((1, 3, 1), (1, 1.5, 1)),
    "roof": box((2, 0.5, 2), (0.5, 5, 0.5)),
}


def boxes_glb() -> Glb:
    glb = Glb()
    for name, corners in BOXES.items():
        glb.node(name=name, mesh=glb.mesh(glb.primitive(corners, BOX_FACES), name=name))
    return glb


def check_boxes(model: Model) -> None:
    assert len(model.parts) == 3
    for part, corners in zip(model.parts, BOXES.values(), strict=True):
        np.testing.assert_allclose(part.pose[:3, :3], np.eye(3), atol=1e-9)
        np.testing.assert_allclose(
            world_triangles(part.vertices, part.faces, part.pose), world_triangles(corners, BOX_FACES), atol=2e-4
        )
        assert part.vertices.dtype == np.float64
        assert part.faces.dtype == np.int32
        assert part.face_colors.shape == (len(part.faces), 3)
        assert part.face_colors.dtype == np.uint8


def merged() -> Any:
    import trimesh

    return trimesh.util.concatenate([trimesh.Trimesh(box, BOX_FACES, process=False) for box in BOXES.values()])


class TestFormats:
    def test_glb_gives_its_nodes(self, tmp_path: Path) -> None:
        model = read_parts(boxes_glb().write(tmp_path / "m.glb"))
        check_boxes(model)
        assert [part.name for part in model.parts] == list(BOXES)
        assert model.segmentation == "nodes"
        assert model.warnings == ()

    def test_gltf_with_an_external_buffer_gives_its_nodes(self, tmp_path: Path) -> None:
        glb = boxes_glb()
        (tmp_path / "all parts.bin").write_bytes(glb.chunk)
        glb.header["buffers"] = [{"byteLength": len(glb.chunk), "uri": "all%20parts.bin"}]
        (tmp_path / "m.gltf").write_text(json.dumps(glb.header), encoding="utf-8")
        check_boxes(read_parts(tmp_path / "m.gltf"))

    def test_glb_that_trimesh_wrote_gives_its_nodes(self, tmp_path: Path) -> None:
        import trimesh

        scene = trimesh.Scene()
        for name, corners in BOXES.items():
            scene.add_geometry(trimesh.Trimesh(corners, BOX_FACES, process=False), node_name=name, geom_name=name)
        scene.export(tmp_path / "m.glb")
        model = read_parts(tmp_path / "m.glb")
        check_boxes(model)
        assert [part.name for part in model.parts] == list(BOXES)
        assert "trimesh" in model.writer

    def test_obj_gives_its_objects(self, tmp_path: Path) -> None:
        model = read_parts(write_obj(tmp_path / "m.obj", BOXES))
        check_boxes(model)
        assert [part.name for part in model.parts] == list(BOXES)
        assert model.segmentation == "objects"

    @pytest.mark.parametrize("suffix", ["ply", "stl", "off"])
    def test_single_mesh_gives_its_components(self, tmp_path: Path, suffix: str) -> None:
        merged().export(tmp_path / f"m.{suffix}")
        model = read_parts(tmp_path / f"m.{suffix}")
        check_boxes(model)
        assert model.segmentation == "components"
        assert "3 connected components" in model.why

    def test_ascii_ply_gives_its_components(self, tmp_path: Path) -> None:
        (tmp_path / "m.ply").write_bytes(merged().export(file_type="ply", encoding="ascii"))
        check_boxes(read_parts(tmp_path / "m.ply"))

    def test_ascii_stl_gives_its_solids(self, tmp_path: Path) -> None:
        import trimesh

        solids = [
            trimesh.Trimesh(box, BOX_FACES, process=False).export(file_type="stl_ascii") for box in BOXES.values()
        ]
        named = [text.replace("solid", f"solid {name}", 1) for name, text in zip(BOXES, solids, strict=True)]
        (tmp_path / "m.stl").write_text("\n".join(named), encoding="utf-8")
        model = read_parts(tmp_path / "m.stl")
        check_boxes(model)
        assert [part.name for part in model.parts] == list(BOXES)

    def test_dae_gives_its_nodes(self, tmp_path: Path) -> None:
        import trimesh
        from trimesh.exchange.dae import export_collada

        meshes = [trimesh.Trimesh(box, BOX_FACES, process=False) for box in BOXES.values()]
        (tmp_path / "m.dae").write_bytes(export_collada(meshes))
        model = read_parts(tmp_path / "m.dae")
        check_boxes(model)
        assert model.segmentation == "nodes"
        assert [part.name for part in model.parts] == ["node0", "node1", "node2"]


class TestNodes:
    def test_parts_stand_in_depth_first_order_with_world_poses(self, tmp_path: Path) -> None:
        glb = Glb()
        cube = glb.mesh(glb.primitive(box(), BOX_FACES), name="cube")
        leaf = glb.node(root=False, name="leaf", mesh=cube, translation=[0, 0, 5])
        twig = glb.node(root=False, name="twig", camera=0, children=[leaf], rotation=[0, 0.5**0.5, 0, 0.5**0.5])
        glb.node(name="empty", translation=[9, 9, 9])
        glb.node(name="trunk", mesh=cube, children=[twig], translation=[10, 0, 0])
        glb.node(name="last", mesh=cube)
        model = read_parts(glb.write(tmp_path / "m.glb"))
        assert [part.name for part in model.parts] == ["trunk", "leaf", "last"]
        # a quarter turn about y takes z to x
        turn = np.array([[0, 0, 1, 15], [0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 0, 1]], dtype=np.float64)
        expected = world_triangles(box(), BOX_FACES, turn)
        leaf_part = model.parts[1]
        np.testing.assert_allclose(world_triangles(leaf_part.vertices, leaf_part.faces, leaf_part.pose), expected)

    def test_names_are_made_unique_and_labels_are_stems(self, tmp_path: Path) -> None:
        glb = Glb()
        cube = glb.mesh(glb.primitive(box(), BOX_FACES), name="cube")
        nameless = glb.mesh(glb.primitive(box((2, 2, 2)), BOX_FACES))
        for name in ("wall", "wall", "wall.001", "beam_12"):
            glb.node(name=name, mesh=cube)
        glb.node(mesh=cube)
        glb.node(mesh=nameless)
        model = read_parts(glb.write(tmp_path / "m.glb"))
        assert [part.name for part in model.parts] == ["wall", "wall#2", "wall.001", "beam_12", "cube", "node5"]
        assert [part.label for part in model.parts] == ["cube", "cube", "wall", "beam", "cube", None]

    def test_several_materials_of_a_node_are_one_part(self, tmp_path: Path) -> None:
        glb = Glb()
        red, blue = glb.material((1, 0, 0), "red"), glb.material((0, 0, 1), "blue")
        cube = glb.mesh(
            glb.primitive(box(), BOX_FACES[:4], material=red), glb.primitive(box(), BOX_FACES[4:], material=blue)
        )
        glb.node(name="a", mesh=cube)
        glb.node(name="b", mesh=cube)
        model = read_parts(glb.write(tmp_path / "m.glb"))
        assert [part.name for part in model.parts] == ["a", "b"]
        part = model.parts[0]
        np.testing.assert_allclose(
            world_triangles(part.vertices, part.faces, part.pose), world_triangles(box(), BOX_FACES)
        )
        assert part.face_colors.tolist() == [[255, 0, 0]] * 4 + [[0, 0, 255]] * 8

    def test_instances_share_their_arrays_though_their_matrices_are_rounded(self, tmp_path: Path) -> None:
        glb = Glb()
        cube = glb.mesh(glb.primitive(box(), BOX_FACES), name="cube")
        for angle in np.linspace(0, 6, 12):
            matrix = np.eye(4, dtype=np.float32)
            matrix[:2, :2] = 0.75 * np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
            matrix[2, 2] = 0.75
            glb.node(mesh=cube, matrix=matrix.T.ravel().tolist())
        model = read_parts(glb.write(tmp_path / "m.glb"))
        assert {part.mesh_name for part in model.parts} == {"cube@0.75"}
        assert all(part.vertices is model.parts[0].vertices for part in model.parts)
        np.testing.assert_allclose(np.ptp(model.parts[0].vertices, axis=0), [0.75] * 3)

    def test_mirrored_instances_are_one_other_mesh_that_faces_outward(self, tmp_path: Path) -> None:
        glb = Glb()
        wedge = box()
        wedge[6:] = wedge[4]  # no mirror image of itself
        mesh = glb.mesh(glb.primitive(wedge, BOX_FACES), name="wedge")
        glb.node(name="plain", mesh=mesh)
        glb.node(name="x", mesh=mesh, scale=[-1, 1, 1])
        glb.node(name="y", mesh=mesh, scale=[1, -1, 1], translation=[5, 0, 0])
        model = read_parts(glb.write(tmp_path / "m.glb"))
        assert [part.mesh_name for part in model.parts] == ["wedge", "wedge@mirror", "wedge@mirror"]
        assert model.parts[1].vertices is model.parts[2].vertices
        for part, mirror in zip(model.parts, ([1, 1, 1], [-1, 1, 1], [1, -1, 1]), strict=True):
            assert np.linalg.det(part.pose[:3, :3]) == pytest.approx(1)
            assert signed_volume(part.vertices, part.faces) > 0
            faces = BOX_FACES if mirror == [1, 1, 1] else BOX_FACES[:, ::-1]
            expected = world_triangles(wedge * mirror + ([5, 0, 0] if part.name == "y" else 0), faces)
            np.testing.assert_allclose(world_triangles(part.vertices, part.faces, part.pose), expected, atol=2e-4)

    @settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
    @given(st.lists(st.floats(-3, 3, width=32), min_size=12, max_size=12))
    def test_any_affine_placement_becomes_a_rigid_pose_of_the_same_surface(
        self, tmp_path: Path, entries: list[float]
    ) -> None:
        matrix = np.eye(4)
        matrix[:3] = np.array(entries).reshape(3, 4)
        if np.linalg.cond(matrix[:3, :3]) > 1e3:
            return
        glb = Glb()
        glb.node(mesh=glb.mesh(glb.primitive(box((1, 2, 3)), BOX_FACES)), matrix=matrix.T.ravel().tolist())
        part = parse_parts(glb.write(tmp_path / "m.glb"), "nodes", ReadLimits()).parts[0]
        rotation = part.pose[:3, :3]
        np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-9)
        assert np.linalg.det(rotation) > 0
        moved = box((1, 2, 3)) @ matrix[:3, :3].T + matrix[:3, 3]
        found = part.vertices @ rotation.T + part.pose[:3, 3]
        np.testing.assert_allclose(found[part.faces].min(axis=(0, 1)), moved.min(axis=0), atol=2e-4)
        np.testing.assert_allclose(found[part.faces].max(axis=(0, 1)), moved.max(axis=0), atol=2e-4)
        assert signed_volume(part.vertices, part.faces) > 0

    def test_lines_points_and_flat_nodes_are_left_out_with_a_warning(self, tmp_path: Path) -> None:
        glb = Glb()
        cube = glb.primitive(box(), BOX_FACES)
        dots = {"attributes": {"POSITION": cube["attributes"]["POSITION"]}, "mode": 0}
        glb.node(name="dots", mesh=glb.mesh(dots, name="dots"))
        glb.node(name="dotted", mesh=glb.mesh(cube, {**dots, "mode": 1}, name="dotted"))
        glb.node(name="flat", mesh=glb.mesh(cube), scale=[1, 0, 1])
        model = read_parts(glb.write(tmp_path / "m.glb"))
        assert [part.name for part in model.parts] == ["dotted"]
        text = " | ".join(model.warnings)
        for word in ("points", "lines", "'dots' has no triangles", "'flat' is scaled to nothing"):
            assert word in text

    @pytest.mark.parametrize(("mode", "order"), [(5, [0, 1, 3, 2]), (6, [0, 1, 2, 3])])
    def test_strips_and_fans_become_triangles_of_one_side(self, tmp_path: Path, mode: int, order: list[int]) -> None:
        glb = Glb()
        square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype="<f4")[order]
        glb.node(mesh=glb.mesh({"attributes": {"POSITION": glb.accessor(square)}, "mode": mode}))
        part = read_parts(glb.write(tmp_path / "m.glb"), "nodes").parts[0]
        corners = part.vertices[part.faces]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        np.testing.assert_allclose(normals, [[0, 0, 1], [0, 0, 1]])

    def test_sparse_and_quantised_accessors_have_their_true_values(self, tmp_path: Path) -> None:
        glb = Glb()
        start = box()
        primitive = glb.primitive(start, BOX_FACES)
        where, new = np.array([6], dtype="<u2"), np.array([[1, 1, 2]], dtype="<f4")
        glb.header["accessors"][primitive["attributes"]["POSITION"]]["sparse"] = {
            "count": 1,
            "indices": {"bufferView": glb.view(where.tobytes()), "componentType": 5123},
            "values": {"bufferView": glb.view(new.tobytes())},
        }
        glb.node(name="sparse", mesh=glb.mesh(primitive))
        quantised = glb.accessor(np.rint(box() * 32767).astype("<i2"), normalized=True)
        glb.node(name="quantised", mesh=glb.mesh({**primitive, "attributes": {"POSITION": quantised}}), scale=[4, 4, 4])
        model = read_parts(glb.write(tmp_path / "m.glb"))
        start[6] = (1, 1, 2)
        for part, expected in zip(model.parts, (start, box((4, 4, 4))), strict=True):
            np.testing.assert_allclose(
                world_triangles(part.vertices, part.faces, part.pose), world_triangles(expected, BOX_FACES), atol=2e-4
            )


class TestColors:
    def test_gltf_factors_are_linear_and_parts_without_material_are_grey(self, tmp_path: Path) -> None:
        glb = Glb()
        material = glb.material((1, 0.21586, 0))
        glb.node(mesh=glb.mesh(glb.primitive(box(), BOX_FACES, material=material)))
        glb.node(mesh=glb.mesh(glb.primitive(box(), BOX_FACES)))
        colored, plain = read_parts(glb.write(tmp_path / "m.glb")).parts
        assert (colored.face_colors == [255, 128, 0]).all()
        assert len(np.unique(plain.face_colors)) == 1

    @pytest.mark.parametrize("embedded", [True, False])
    def test_textures_are_sampled_under_the_centroid_of_faces(self, tmp_path: Path, embedded: bool) -> None:
        glb = Glb()
        pixels = np.array([[[200, 0, 0], [0, 200, 0]], [[0, 0, 200], [90, 90, 90]]])
        if embedded:
            glb.header["images"] = [{"bufferView": glb.view(png(pixels)), "mimeType": "image/png"}]
        else:
            (tmp_path / "map.png").write_bytes(png(pixels))
            glb.header["images"] = [{"uri": "map.png"}]
        glb.header["textures"] = [{"source": 0}]
        glb.header["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
        # glTF puts the origin of texture coordinates at the upper left, and they repeat
        uv = np.array([[0.1, 0.1], [0.3, 0.1], [0.1, 0.3]], dtype="<f4")
        corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype="<f4")
        shifts = ((0, 0), (0.5, 0), (0, 0.5), (2.5, -1.5))
        position = glb.accessor(np.concatenate([corners + np.array([0, 0, k]) for k in range(4)]).astype("<f4"))
        coordinates = glb.accessor(np.concatenate([uv + shift for shift in shifts]).astype("<f4"))
        glb.node(mesh=glb.mesh({"attributes": {"POSITION": position, "TEXCOORD_0": coordinates}, "material": 0}))
        part = read_parts(glb.write(tmp_path / "m.glb"), "nodes").parts[0]
        assert part.face_colors.tolist() == [[200, 0, 0], [0, 200, 0], [0, 0, 200], [90, 90, 90]]

    def test_texture_that_is_no_image_is_a_warning(self, tmp_path: Path) -> None:
        glb = Glb()
        glb.header["images"] = [{"uri": "gone.png"}, {"bufferView": glb.view(b"no image")}]
        glb.header["textures"] = [{"source": 0}, {"source": 1}]
        for index in (0, 1):
            glb.header["materials"].append({"pbrMetallicRoughness": {"baseColorTexture": {"index": index}}})
            uv = glb.accessor(np.zeros((8, 2), dtype="<f4"))
            primitive = glb.primitive(box(), BOX_FACES, material=index)
            primitive["attributes"]["TEXCOORD_0"] = uv
            glb.node(mesh=glb.mesh(primitive))
        model = read_parts(glb.write(tmp_path / "m.glb"))
        assert len(model.parts) == 2
        assert "gone.png" in model.warnings[0]
        assert "embedded" in model.warnings[1]

    def test_ply_face_colours_stay_with_their_polygons(self, tmp_path: Path) -> None:
        head = """ply
format {} 1.0
element vertex 5
property float x
property float y
property float z
element face 3
property list uchar int vertex_indices
property uchar red
property uchar green
property uchar blue
end_header
"""
        rows = [(3, 0, 1, 4, 0, 0, 255), (4, 0, 1, 2, 3, 0, 255, 0), (3, 1, 2, 4, 9, 9, 9)]
        points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1)]
        text = head.format("ascii") + "\n".join(" ".join(map(str, row)) for row in (*points, *rows)) + "\n"
        (tmp_path / "text.ply").write_text(text, encoding="utf-8")
        body = np.array(points, dtype="<f4").tobytes()
        for size, *rest in rows:
            body += bytes([size]) + np.array(rest[:size], dtype="<i4").tobytes() + bytes(rest[size:])
        (tmp_path / "binary.ply").write_bytes(head.format("binary_little_endian").encode() + body)
        for name in ("text.ply", "binary.ply"):
            part = read_parts(tmp_path / name, "objects").parts[0]
            assert part.face_colors.tolist() == [[0, 0, 255], [0, 255, 0], [0, 255, 0], [9, 9, 9]]

    def test_off_carries_face_and_vertex_colours(self, tmp_path: Path) -> None:
        points = "0 0 0{0}\n1 0 0{0}\n0 1 0{0}\n0 0 1{1}\n"
        (tmp_path / "f.off").write_text(
            "OFF\n4 2 0\n" + points.format("", "") + "3 0 1 2 255 0 0\n3 0 1 3 0.0 0.5 1.0  # blue\n", encoding="utf-8"
        )
        (tmp_path / "v.off").write_text(
            "COFF\n4 2 0\n" + points.format(" 10 20 30 255", " 7 7 7 255") + "3 0 1 2\n3 0 1 3\n", encoding="utf-8"
        )
        assert read_parts(tmp_path / "f.off", "objects").parts[0].face_colors.tolist() == [[255, 0, 0], [0, 128, 255]]
        assert read_parts(tmp_path / "v.off", "objects").parts[0].face_colors.tolist() == [[10, 20, 30], [10, 20, 30]]

    @pytest.mark.parametrize(
        ("said", "up", "corner"), [("Y_UP", "y", (1, 2, 3)), ("Z_UP", "z", (1, 2, 3)), ("X_UP", "y", (-2, 1, 3))]
    )
    def test_dae_is_read_in_metres_with_the_axis_that_it_calls_up(
        self, said: str, up: str, corner: tuple[float, ...], tmp_path: Path
    ) -> None:
        import trimesh
        from trimesh.exchange.dae import export_collada

        mesh = trimesh.creation.box((2, 4, 6))
        mesh.apply_translation((1, 2, 3))  # from the origin to 2, 4, 6 of a unit of half a metre
        text = export_collada(mesh).decode()
        head, tail = text.split("<asset>", 1)
        units = f'<unit name="half" meter="0.5"/><up_axis>{said}</up_axis>'
        (tmp_path / "m.dae").write_text(
            f"{head}<asset>{re.sub('<up_axis>.*</up_axis>', units, tail, count=1)}", encoding="utf-8"
        )
        model = read_parts(tmp_path / "m.dae", "nodes")
        (part,) = model.parts
        world = part.vertices @ part.pose[:3, :3].T + part.pose[:3, 3]
        assert model.up == up
        far = world[np.abs(world).sum(axis=1).argmax()]
        np.testing.assert_allclose(far, corner, atol=1e-6)

    def test_dae_diffuse_colours_are_kept(self, tmp_path: Path) -> None:
        import trimesh
        from trimesh.exchange.dae import export_collada

        mesh = trimesh.Trimesh(box(), BOX_FACES, process=False)
        mesh.visual.face_colors = [255, 51, 0, 255]
        (tmp_path / "m.dae").write_bytes(export_collada(mesh))
        assert (read_parts(tmp_path / "m.dae", "nodes").parts[0].face_colors == [255, 51, 0]).all()


class TestWavefront:
    def test_materials_and_textures_come_from_the_library(self, tmp_path: Path) -> None:
        (tmp_path / "my colours.mtl").write_text(
            "newmtl red\nKd 1 0 0\nnewmtl tiled\nKd 0 0 0\nmap_Kd -s 1 1 1 -clamp on tile map.png\n", encoding="utf-8"
        )
        (tmp_path / "tile map.png").write_bytes(png(np.array([[[1, 2, 3]]])))
        lines = """mtllib my colours.mtl
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
vt 0 0
usemtl red
f 1/1 2/1 3/1
usemtl tiled
f -4/-1 -2/-1 -1/-1
usemtl unknown
f 1 2 \\
 3
"""
        (tmp_path / "m.obj").write_text(lines, encoding="utf-8")
        model = read_parts(tmp_path / "m.obj", "objects")
        assert model.parts[0].face_colors[:2].tolist() == [[255, 0, 0], [1, 2, 3]]
        assert len(model.parts[0].faces) == 3
        assert "'unknown'" in model.warnings[0]

    @pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
    def test_text_in_another_encoding_is_read(self, tmp_path: Path, encoding: str) -> None:
        path = write_obj(tmp_path / "m.obj", BOXES)
        path.write_text(path.read_text(encoding="utf-8"), encoding=encoding)
        assert [part.name for part in read_parts(path).parts] == list(BOXES)

    def test_two_libraries_on_one_line_are_both_read(self, tmp_path: Path) -> None:
        (tmp_path / "a.mtl").write_text("newmtl a\nKd 1 0 0\n", encoding="utf-8")
        (tmp_path / "b.mtl").write_text("newmtl b\nKd 0 1 0\n", encoding="utf-8")
        write_obj(tmp_path / "m.obj", BOXES, "mtllib a.mtl b.mtl", {"base": "usemtl b", "tower": "usemtl a"})
        colors = [part.face_colors[0].tolist() for part in read_parts(tmp_path / "m.obj").parts]
        assert colors == [[0, 255, 0], [255, 0, 0], [255, 0, 0]]

    def test_missing_library_is_a_warning(self, tmp_path: Path) -> None:
        model = read_parts(write_obj(tmp_path / "m.obj", BOXES, "mtllib gone.mtl"))
        check_boxes(model)
        assert "gone.mtl" in model.warnings[0]

    def test_groups_are_the_objects_where_there_is_but_one_object(self, tmp_path: Path) -> None:
        path = write_obj(tmp_path / "m.obj", BOXES)
        path.write_text("o everything\n" + path.read_text(encoding="utf-8").replace("\no ", "\ng "), encoding="utf-8")
        assert [part.name for part in read_parts(path).parts] == list(BOXES)

    @pytest.mark.parametrize(("keyword", "names"), [("o", [*BOXES, "base#2"]), ("g", list(BOXES))])
    def test_object_of_one_name_begins_again_and_group_goes_on(
        self, tmp_path: Path, keyword: str, names: list[str]
    ) -> None:
        path = write_obj(tmp_path / "m.obj", BOXES)
        text = path.read_text(encoding="utf-8").replace("\no ", f"\n{keyword} ")
        path.write_text(text + f"{keyword} base\nf 1 2 3\n", encoding="utf-8")
        assert [part.name for part in read_parts(path).parts] == names

    def test_concave_polygons_are_not_filled_beyond_their_outline(self, tmp_path: Path) -> None:
        outline = [(0, 0), (5, 0), (5, 3), (4, 3), (4, 1), (3, 1), (3, 2), (2, 2), (2, 1), (1, 1), (1, 3), (0, 3)]
        dart = [(10, 0), (12, 1), (10, 2), (11, 1)]
        points = [(x, 7, y) for x, y in outline + dart]
        lines = [f"v {x} {y} {z}" for x, y, z in points]
        lines += ["f " + " ".join(str(k + 1) for k in range(12)), "f 13 14 15 16"]
        (tmp_path / "m.obj").write_text("\n".join(lines), encoding="utf-8")
        part = read_parts(tmp_path / "m.obj", "objects").parts[0]
        corners = part.vertices[part.faces]
        areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 1] / 2
        assert len(areas) == 12
        assert (areas <= 0).all()  # counterclockwise in x and z looks down y
        assert areas.sum() == pytest.approx(-(5 + 2 + 2 + 1) - 1)

    @pytest.mark.parametrize("line", ["f 1 2 99", "f 1 2 0", "v 1 2", "v a b c", "f 1 2 x"])
    def test_broken_line_is_named(self, tmp_path: Path, line: str) -> None:
        path = write_obj(tmp_path / "m.obj", BOXES)
        count = len(path.read_text(encoding="utf-8").splitlines())
        path.write_text(path.read_text(encoding="utf-8") + line + "\n", encoding="utf-8")
        with pytest.raises(ConfigError, match=f"m.obj, line {count + 1}: '{line}'"):
            read_parts(path)


class TestDae:
    DOCUMENT = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><created>2020-01-01T00:00:00Z</created><modified>2020-01-01T00:00:00Z</modified></asset>
<library_images><image id="i"><init_from>IMAGE</init_from></image></library_images>
<library_geometries><geometry id="g" name="tile"><mesh>
<source id="p"><float_array id="pa" count="12">0 0 0 1 0 0 1 1 0 0 1 0</float_array><technique_common>
<accessor source="#pa" count="4" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<polylist count="1"><input semantic="VERTEX" source="#v" offset="0"/><vcount>4</vcount><p>0 1 2 3</p></polylist>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s">
<node id="n1" name="Tile.001"><translate>5 0 0</translate><instance_geometry url="#g"/>
<node id="n2" name="Tile.002"><scale>2 2 2</scale><instance_geometry url="#g"/></node></node>
<node id="n3" name="Tile.003"><instance_geometry url="#g"/></node>
</visual_scene></library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>"""

    def test_instances_share_a_mesh_and_nodes_nest(self, tmp_path: Path) -> None:
        (tmp_path / "m.dae").write_text(self.DOCUMENT.replace("IMAGE", "a.png"), encoding="utf-8")
        model = read_parts(tmp_path / "m.dae")
        assert [part.name for part in model.parts] == ["Tile.001", "Tile.002", "Tile.003"]
        assert [part.label for part in model.parts] == ["Tile"] * 3
        assert [part.mesh_name for part in model.parts] == ["tile", "tile@2", "tile"]
        np.testing.assert_allclose(model.parts[1].pose[:3, 3], [6, 1, 0])
        np.testing.assert_allclose(np.ptp(model.parts[1].vertices, axis=0), [2, 2, 0])

    def test_entities_are_refused(self, tmp_path: Path) -> None:
        text = self.DOCUMENT.replace("?>", '?><!DOCTYPE x [<!ENTITY e SYSTEM "file:///etc/passwd">]>', 1)
        (tmp_path / "m.dae").write_text(text.replace("IMAGE", "a.png"), encoding="utf-8")
        with pytest.raises(ConfigError, match="entities"):
            read_parts(tmp_path / "m.dae")


class TestBadFiles:
    def test_glb_that_is_cut_off_anywhere_is_refused(self, tmp_path: Path) -> None:
        content = boxes_glb().content()
        for length in [1, 3, 11, 13, 19, 21, *range(30, len(content), 97), len(content) - 1]:
            (tmp_path / "m.glb").write_bytes(content[:length])
            with pytest.raises(ConfigError, match=r"m.glb: (truncated|not a glTF)"):
                read_parts(tmp_path / "m.glb")

    @pytest.mark.parametrize("suffix", ["ply", "stl", "off", "dae"])
    def test_other_formats_that_are_cut_off_are_refused(self, tmp_path: Path, suffix: str) -> None:
        merged().export(tmp_path / f"m.{suffix}")
        content = (tmp_path / f"m.{suffix}").read_bytes()
        for length in range(1, len(content) - 60, len(content) // 23):
            (tmp_path / f"m.{suffix}").write_bytes(content[:length])
            faults = "not a whole|holds no triangles|holds zero bytes only"
            with pytest.raises(ConfigError, match=f"m.{suffix}: ({faults})"):
                read_parts(tmp_path / f"m.{suffix}")

    def test_cut_off_ascii_stl_is_refused(self, tmp_path: Path) -> None:
        text = merged().export(file_type="stl_ascii")
        (tmp_path / "m.stl").write_text(text[: len(text) // 2], encoding="utf-8")
        with pytest.raises(ConfigError, match="does not end"):
            read_parts(tmp_path / "m.stl")

    @settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
    @given(st.lists(st.tuples(st.integers(0, 10_000), st.integers(0, 255)), min_size=1, max_size=6))
    def test_damaged_glb_is_read_or_refused_but_never_breaks(
        self, tmp_path: Path, damage: list[tuple[int, int]]
    ) -> None:
        content = bytearray(boxes_glb().content())
        for place, value in damage:
            content[place % len(content)] = value
        (tmp_path / "m.glb").write_bytes(bytes(content))
        parts: tuple[RawPart, ...] = ()
        with contextlib.suppress(ConfigError):
            parts = parse_parts(tmp_path / "m.glb", "nodes", ReadLimits()).parts
        assert all(np.isfinite(part.vertices).all() for part in parts)

    def test_external_buffer_that_is_too_short_is_refused(self, tmp_path: Path) -> None:
        glb = boxes_glb()
        (tmp_path / "m.bin").write_bytes(glb.chunk[:-40])
        glb.header["buffers"] = [{"byteLength": len(glb.chunk), "uri": "m.bin"}]
        (tmp_path / "m.gltf").write_text(json.dumps(glb.header), encoding="utf-8")
        with pytest.raises(ConfigError, match="cut off"):
            read_parts(tmp_path / "m.gltf")
        (tmp_path / "m.bin").unlink()
        with pytest.raises(ConfigError, match=r"'m.bin', which is missing"):
            read_parts(tmp_path / "m.gltf")

    def test_mesh_without_triangles_is_refused(self, tmp_path: Path) -> None:
        glb = Glb()
        glb.node(name="nothing", mesh=glb.mesh(glb.primitive(box(), np.empty((0, 3)))))
        glb.write(tmp_path / "m.glb")
        (tmp_path / "m.obj").write_text("v 0 0 0\nv 1 0 0\n", encoding="utf-8")
        (tmp_path / "m.off").write_text("OFF\n0 0 0\n", encoding="utf-8")
        (tmp_path / "m.stl").write_bytes(b"solid without a triangle".ljust(80) + b"\0" * 4)
        for suffix in ("glb", "obj", "off", "stl"):
            with pytest.raises(ConfigError, match=f"m.{suffix}: holds no triangles"):
                read_parts(tmp_path / f"m.{suffix}")

    def test_one_empty_part_is_left_out_with_a_warning(self, tmp_path: Path) -> None:
        glb = boxes_glb()
        glb.node(name="nothing", mesh=glb.mesh(glb.primitive(box(), np.empty((0, 3)))))
        model = read_parts(glb.write(tmp_path / "m.glb"))
        check_boxes(model)
        assert model.warnings == ("part 'nothing' has no triangles and is left out",)

    @pytest.mark.parametrize("number", [np.nan, np.inf])
    def test_coordinates_that_are_not_finite_name_the_part(self, tmp_path: Path, number: float) -> None:
        glb = boxes_glb()
        broken = box()
        broken[3, 1] = number
        glb.node(name="broken", mesh=glb.mesh(glb.primitive(broken, BOX_FACES)))
        with pytest.raises(ConfigError, match="part 'broken' has 1 vertices that are not finite"):
            read_parts(glb.write(tmp_path / "m.glb"))
        with pytest.raises(ConfigError, match="part 'bad' has 1 vertices that are not finite"):
            read_parts(write_obj(tmp_path / "m.obj", {**BOXES, "bad": broken}))

    def test_vertex_that_no_face_uses_may_be_anything(self, tmp_path: Path) -> None:
        glb = Glb()
        glb.node(mesh=glb.mesh(glb.primitive(np.vstack([box(), [[np.nan] * 3]]), BOX_FACES)))
        assert np.isfinite(read_parts(glb.write(tmp_path / "m.glb"), "nodes").parts[0].vertices).all()

    def test_face_on_a_missing_vertex_is_refused(self, tmp_path: Path) -> None:
        glb = Glb()
        glb.node(mesh=glb.mesh(glb.primitive(box(), BOX_FACES + 5), name="cube"))
        with pytest.raises(ConfigError, match=r"'cube'.*vertex 12 of 8"):
            read_parts(glb.write(tmp_path / "m.glb"))

    @pytest.mark.parametrize(
        ("extension", "element"),
        [
            ("KHR_draco_mesh_compression", "primitive"),
            ("EXT_meshopt_compression", "view"),
            ("EXT_mesh_gpu_instancing", "node"),
        ],
    )
    def test_compression_that_is_not_read_is_named_with_the_mend(
        self, tmp_path: Path, extension: str, element: str
    ) -> None:
        glb = Glb()
        primitive = glb.primitive(box(), BOX_FACES)
        glb.node(name="n", mesh=glb.mesh(primitive))
        if element == "primitive":
            primitive["extensions"] = {extension: {"bufferView": 0}}
            del glb.header["accessors"][0]["bufferView"]
        elif element == "view":
            glb.header["bufferViews"][0].update(buffer=1, extensions={extension: {}})
            glb.header["buffers"] = [{"byteLength": len(glb.chunk)}, {"byteLength": 96}]
        else:
            glb.header["nodes"][0]["extensions"] = {extension: {}}
        word = {"primitive": "Draco", "view": "meshopt", "node": extension}[element]
        with pytest.raises(ConfigError, match=f"{word}.* export it again with"):
            read_parts(glb.write(tmp_path / "m.glb"))

    def test_nodes_in_a_ring_are_refused(self, tmp_path: Path) -> None:
        glb = boxes_glb()
        glb.header["nodes"][0]["children"] = [1]
        glb.header["nodes"][1]["children"] = [0]
        with pytest.raises(ConfigError, match="two parents"):
            read_parts(glb.write(tmp_path / "m.glb"))

    def test_what_is_no_model_file_is_refused_with_the_nearest_right_thing(self, tmp_path: Path) -> None:
        boxes_glb().write(tmp_path / "castle.glb")
        (tmp_path / "folder.glb").mkdir()
        (tmp_path / "empty.glb").touch()
        (tmp_path / "text.glb").write_text("hello", encoding="utf-8")
        for name, message in {
            "castel.glb": "no such file; did you mean castle.glb",
            "folder.glb": "is a folder",
            "empty.glb": "is empty",
            "text.glb": "not a glTF file",
            "castle.gbl": "did you mean .glb",
            "castle": "Shapemill reads .glb, .gltf, .obj",
        }.items():
            with pytest.raises(ConfigError, match=message):
                read_parts(tmp_path / name)

    @pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
    def test_file_without_permission_is_refused(self, tmp_path: Path) -> None:
        path = boxes_glb().write(tmp_path / "m.glb")
        path.chmod(0)
        with pytest.raises(ConfigError, match="permission"):
            read_parts(path)


class TestSize:
    @pytest.mark.parametrize(("scale", "said"), [(1e-12, "e-12 units across"), (1e12, "e+12 units across")])
    def test_model_that_numbers_cannot_carry_is_refused_with_its_size(
        self, scale: float, said: str, tmp_path: Path
    ) -> None:
        scaled = boxes_glb()
        scaled.header["scenes"] = [{"nodes": [3]}]
        scaled.node(root=False, children=[0, 1, 2], scale=[scale] * 3)
        with pytest.raises(ConfigError, match="scale it in the modelling tool") as caught:
            read_parts(scaled.write(tmp_path / "scaled.glb"))
        assert said in str(caught.value)
        assert "scaled.glb: the model is" in str(caught.value)

    @pytest.mark.parametrize("scale", [2.0**-26, 2.0**26])
    def test_model_of_any_size_in_use_has_the_same_parts(self, scale: float, tmp_path: Path) -> None:
        scaled = boxes_glb()
        scaled.header["scenes"] = [{"nodes": [3]}]
        scaled.node(root=False, children=[0, 1, 2], scale=[scale] * 3)
        plain = read_parts(boxes_glb().write(tmp_path / "plain.glb"))
        for one, other in zip(plain.parts, read_parts(scaled.write(tmp_path / "s.glb")).parts, strict=True):
            np.testing.assert_allclose(other.vertices, scale * one.vertices, rtol=1e-5, atol=1e-5 * scale)
            np.testing.assert_allclose(other.pose[:3, :3], one.pose[:3, :3], atol=1e-9)


class TestFarFromTheOrigin:
    def test_million_unit_offset_changes_no_relative_pose(self, tmp_path: Path) -> None:
        # halves and whole numbers are exact in 32 bits a million units away
        at_home = boxes_glb()
        away = boxes_glb()
        away.header["scenes"] = [{"nodes": [3]}]
        away.node(root=False, children=[0, 1, 2], translation=[1_000_000, -2_000_000, 500_000])
        home = read_parts(at_home.write(tmp_path / "home.glb"))
        far = read_parts(away.write(tmp_path / "far.glb"))
        assert home.warnings == ()
        assert "2.291e+06 units from the origin" in far.warnings[0]
        for one, other in zip(home.parts, far.parts, strict=True):
            np.testing.assert_array_equal(one.vertices, other.vertices)
            moved = other.pose[:3, 3] - far.parts[0].pose[:3, 3]
            np.testing.assert_allclose(moved, one.pose[:3, 3] - home.parts[0].pose[:3, 3], atol=1e-9)
        assert np.abs([part.pose for part in far.parts]).max() < 10

    def test_offset_in_the_vertices_is_taken_off_too(self, tmp_path: Path) -> None:
        shift = np.array([1_000_000, 0, -4_000_000])
        write_obj(tmp_path / "far.obj", {name: corners + shift for name, corners in BOXES.items()})
        write_obj(tmp_path / "home.obj", BOXES)
        home, far = read_parts(tmp_path / "home.obj"), read_parts(tmp_path / "far.obj")
        assert "contacts may be lost" in far.warnings[0]
        for one, other in zip(home.parts, far.parts, strict=True):
            np.testing.assert_array_equal(one.vertices, other.vertices)
            moved = other.pose[:3, 3] - far.parts[0].pose[:3, 3]
            np.testing.assert_allclose(moved, one.pose[:3, 3] - home.parts[0].pose[:3, 3], atol=1e-9)


_opened: list[str] | None = None


def _listen(event: str, arguments: tuple[Any, ...]) -> None:
    if event == "open" and _opened is not None:
        _opened.append(str(arguments[0]))


sys.addaudithook(_listen)


@contextlib.contextmanager
def opened_files() -> Iterator[list[str]]:
    global _opened
    _opened = found = []
    try:
        yield found
    finally:
        _opened = None


def gltf_buffer(folder: Path, name: str) -> Path:
    glb = boxes_glb()
    glb.header["buffers"] = [{"byteLength": len(glb.chunk), "uri": name}]
    (folder / "m.gltf").write_text(json.dumps(glb.header), encoding="utf-8")
    return folder / "m.gltf"


def gltf_image(folder: Path, name: str) -> Path:
    return textured_glb(name).write(folder / "m.glb")


def obj_library(folder: Path, name: str) -> Path:
    return write_obj(folder / "m.obj", BOXES, f"mtllib {name}")


def obj_texture(folder: Path, name: str) -> Path:
    (folder / "m.mtl").write_text(f"newmtl a\nmap_Kd {name}\n", encoding="utf-8")
    return write_obj(folder / "m.obj", BOXES, "mtllib m.mtl")


def dae_image(folder: Path, name: str) -> Path:
    (folder / "m.dae").write_text(textured_dae(name), encoding="utf-8")
    return folder / "m.dae"


def ply_texture(folder: Path, name: str) -> Path:
    text = merged().export(file_type="ply", encoding="ascii").decode()
    (folder / "m.ply").write_text(
        text.replace("\nelement", f"\ncomment TextureFile {name}\nelement", 1), encoding="utf-8"
    )
    return folder / "m.ply"


WRITERS = [gltf_buffer, gltf_image, obj_library, obj_texture, dae_image, ply_texture]


class TestEnclosure:
    @pytest.mark.parametrize("writer", WRITERS)
    @pytest.mark.parametrize(
        "name",
        [
            "../secret.bin",
            "sub/../../secret.bin",
            "..\\secret.bin",
            "%2e%2e/secret.bin",
            "%252e%252e%252fsecret.bin",
            "{absolute}",
            "file://{absolute}",
            "http://127.0.0.1:9/secret.bin",
            "C:\\secret.bin",
            "~/secret.bin",
            "link/secret.bin",
            "link.bin",
        ],
    )
    def test_nothing_outside_the_folder_is_opened(
        self, tmp_path: Path, writer: Callable[[Path, str], Path], name: str
    ) -> None:
        secret = tmp_path / "secret.bin"
        secret.write_bytes(boxes_glb().chunk)
        folder = tmp_path / "models"
        (folder / "sub").mkdir(parents=True)
        (folder / "link").symlink_to(tmp_path)
        (folder / "link.bin").symlink_to(secret)
        path = writer(folder, name.format(absolute=secret))
        with opened_files() as opened:
            if writer is gltf_buffer:
                with pytest.raises(ConfigError, match="a path outside the folder"):
                    parse_parts(path, "auto", ReadLimits())
            else:  # it costs the colours and not the model
                (warning,) = parse_parts(path, "auto", ReadLimits()).warnings
                assert "outside the folder" in warning
        assert str(path) in opened
        assert [
            path for path in opened if path.startswith(str(tmp_path)) and ("secret" in path or "link" in path)
        ] == []

    def test_files_in_folders_below_are_read(self, tmp_path: Path) -> None:
        (tmp_path / "maps" / "deep").mkdir(parents=True)
        (tmp_path / "maps" / "deep" / "b.bin").write_bytes(boxes_glb().chunk)
        check_boxes(read_parts(gltf_buffer(tmp_path, "maps/./deep/../deep/b.bin")))

    def test_data_uri_needs_no_file(self, tmp_path: Path) -> None:
        import base64

        text = base64.b64encode(boxes_glb().chunk).decode()
        check_boxes(read_parts(gltf_buffer(tmp_path, f"data:application/octet-stream;base64,{text}")))
        with pytest.raises(ConfigError, match="not valid base64"):
            read_parts(gltf_buffer(tmp_path, "data:application/octet-stream;base64,###"))


@pytest.mark.skipif(not EXEMPLARS.is_dir(), reason="the real exemplars are not here")
def test_real_exemplars_have_the_parts_of_their_lists_in_order() -> None:
    folders = sorted(file.parent for file in EXEMPLARS.glob("*/exemplar.json"))
    assert len(folders) >= 29
    for folder in folders:
        described = json.loads((folder / "exemplar.json").read_text(encoding="utf-8"))
        model = read_parts(folder / "model.glb", "nodes")
        if "part_list" in described:
            assert [part.name for part in model.parts] == [part["node"] for part in described["part_list"]], folder.name
            assert [part.label for part in model.parts] == [part["type"] for part in described["part_list"]], (
                folder.name
            )
            assert len({part.mesh_name for part in model.parts}) == described["types"], folder.name
        assert len(model.parts) == described["parts"], folder.name
        assert sum(len(part.faces) for part in model.parts) == described["triangles"], folder.name
        assert model.warnings == (), folder.name


class TestCutsThatFail:
    def failing(self, monkeypatch: pytest.MonkeyPatch) -> None:
        def fail(_: Any) -> Any:
            raise ValueError("no such face")

        monkeypatch.setattr(segmentation, "cut_by_symmetry", fail)

    def test_auto_reads_the_mesh_without_the_cut_and_warns(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        self.failing(monkeypatch)
        glb = Glb()
        glb.node(name="all", mesh=glb.mesh(glb.primitive(BOXES["base"], BOX_FACES), name="all"))
        model = read_parts(glb.write(tmp_path / "m.glb"))
        assert [part.name for part in model.parts] == ["all"]
        assert "one connected component, which is not cut" in model.why
        assert re.match(r"cutting it by symmetry failed: .*other ways", model.warnings[-1])

    def test_stated_cut_that_fails_names_the_cut(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.failing(monkeypatch)
        with pytest.raises(ConfigError, match=r"can be read, but `parts: symmetry` failed: something is in it"):
            read_parts(boxes_glb().write(tmp_path / "m.glb"), "symmetry")
