"""What makes a part: nodes, materials, colours and connected components."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.errors import ConfigError
from stages.exemplars.read import read_parts
from stages.exemplars.segmentation import count_parts, pick_segmentation, segment_scene
from stages.model_files.scene import ModelScene, Placement, Surface
from stages.shape.geometry.connected_faces import connected_faces
from tests.stages.exemplars.model_files import BOX_FACES, Glb, box, signed_volume, write_obj

RED, BLUE = (255, 0, 0), (0, 0, 255)


def boxes(corners: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    return np.concatenate(corners), np.concatenate([BOX_FACES + 8 * number for number in range(len(corners))])


def painted(corners: list[np.ndarray], colors: list[tuple[int, int, int]]) -> ModelScene:
    """Return one surface of boxes with different colours."""
    vertices, faces = boxes(corners)
    paint = np.repeat(np.array(colors, dtype=np.uint8), 12, axis=0)
    surface = Surface("all", vertices, faces.astype(np.int32), paint, paint=paint)
    return ModelScene("objects", (surface,), (Placement("all", None, 0, np.eye(4)),))


def grid(size: int) -> list[np.ndarray]:
    return [box((1, 1, 1), (x, y, z)) for x in range(size) for y in range(size) for z in range(size)]


class TestAuto:
    def test_nodes_come_before_everything_else(self, tmp_path: Path) -> None:
        glb = Glb()
        red, blue = glb.material((1, 0, 0)), glb.material((0, 0, 1))
        two = glb.mesh(glb.primitive(box(), BOX_FACES, material=red), glb.primitive(box(), BOX_FACES, material=blue))
        glb.node(name="a", mesh=two)
        glb.node(name="b", mesh=two, translation=[3, 0, 0])
        model = read_parts(glb.write(tmp_path / "m.glb"))
        assert (model.segmentation, len(model.parts)) == ("nodes", 2)
        assert model.why == "2 scene nodes"

    def test_materials_of_one_node_are_labels_of_its_pieces(self, tmp_path: Path) -> None:
        glb = Glb()
        brick, roof = glb.material((1, 0, 0), "brick"), glb.material((0, 0, 1), "roof")
        walls, faces = boxes([box(), box(at=(5, 0, 0))])
        top = glb.primitive(box(at=(0, 1, 0)), BOX_FACES, material=roof)
        glb.node(mesh=glb.mesh(glb.primitive(walls, faces, material=brick), top, name="house"))
        model = read_parts(glb.write(tmp_path / "m.glb"))
        assert model.segmentation == "materials"
        assert [part.name for part in model.parts] == ["brick", "brick#2", "roof"]
        assert [part.label for part in model.parts] == ["brick", "brick", "roof"]
        assert "one scene node" in model.why
        assert "3 connected pieces of 2 materials" in model.why

    def test_one_material_tells_nothing_so_components_are_taken(self, tmp_path: Path) -> None:
        glb = Glb()
        vertices, faces = boxes([box(), box(at=(5, 0, 0))])
        glb.node(mesh=glb.mesh(glb.primitive(vertices, faces, material=glb.material((1, 0, 0), "brick"))))
        model = read_parts(glb.write(tmp_path / "m.glb"))
        assert model.segmentation == "components"
        assert [part.name for part in model.parts] == ["component-000", "component-001"]

    def test_colours_of_one_object_are_labels_of_its_pieces(self) -> None:
        scene = painted([box(), box(at=(1, 0, 0)), box(at=(2, 0, 0))], [RED, BLUE, RED])
        source, why, parted = pick_segmentation(scene)
        assert source == "colors"
        assert "3 connected pieces of 2 face or vertex colours" in why
        assert [part.name for part in parted.placements] == ["#ff0000", "#0000ff", "#ff0000#2"]

    def test_shading_is_no_label(self) -> None:
        corners = [box(at=(3 * k, 0, 0)) for k in range(70)]
        source, why, _ = pick_segmentation(painted(corners, [(k, k, k) for k in range(70)]))
        assert source == "components"
        assert "70 colours, which are shading" in why

    def test_one_solid_is_one_part_and_says_so(self, tmp_path: Path) -> None:
        model = read_parts(write_obj(tmp_path / "m.obj", {"only": box()}))
        assert (model.segmentation, len(model.parts)) == ("objects", 1)
        assert "nothing tells parts apart" in model.why


class TestSources:
    def test_source_that_the_model_lacks_is_refused_with_those_it_has(self, tmp_path: Path) -> None:
        path = write_obj(tmp_path / "m.obj", {"a": box(), "b": box(at=(2, 0, 0))})
        with pytest.raises(ConfigError, match=r"has no colors.* objects \(2\), components \(2\)"):
            read_parts(path, "colors")
        with pytest.raises(ConfigError, match="has no nodes"):
            read_parts(path, "nodes")

    def test_pieces_of_instances_stay_shared(self, tmp_path: Path) -> None:
        glb = Glb()
        vertices, faces = boxes([box(), box(at=(5, 0, 0))])
        mesh = glb.mesh(glb.primitive(vertices, faces), name="pair")
        glb.node(name="left", mesh=mesh)
        glb.node(name="right", mesh=mesh, translation=[0, 9, 0])
        parts = read_parts(glb.write(tmp_path / "m.glb"), "components").parts
        assert [part.name for part in parts] == [
            f"{node}/component-{k:03d}" for node in ("left", "right") for k in range(2)
        ]
        assert parts[1].vertices is parts[3].vertices
        np.testing.assert_allclose(parts[3].pose[:3, 3], [5.5, 9.5, 0.5])

    def test_vertex_colours_label_faces_without_mixing(self, tmp_path: Path) -> None:
        vertices, faces = boxes([box(), box(at=(1, 0, 0))])
        colors = np.repeat([RED, BLUE], 8, axis=0)
        lines = [
            f"v {x} {y} {z} {r / 255} {g} {b / 255}" for (x, y, z), (r, g, b) in zip(vertices, colors, strict=True)
        ]
        lines += [f"f {a} {b} {c}" for a, b, c in faces + 1]
        (tmp_path / "m.obj").write_text("\n".join(lines), encoding="utf-8")
        model = read_parts(tmp_path / "m.obj")
        assert model.segmentation == "colors"
        assert [part.name for part in model.parts] == ["#ff0000", "#0000ff"]
        assert (model.parts[1].face_colors == BLUE).all()

    def test_counts_are_what_segmenting_gives(self) -> None:
        scene = painted([box(), box(at=(1, 0, 0)), box(at=(2, 0, 0))], [RED, BLUE, RED])
        for source, count in count_parts(scene).items():
            assert len(segment_scene(scene, source).placements) == count


class TestComponents:
    def test_boxes_that_touch_in_faces_edges_and_corners_stay_apart(self) -> None:
        vertices, faces = boxes(grid(3))
        component = connected_faces(vertices, faces, np.zeros(len(faces), int))
        np.testing.assert_array_equal(component, np.repeat(np.arange(27), 12))

    @settings(max_examples=30, deadline=None)
    @given(st.permutations(range(8 * 12)), st.integers(0, 2**32 - 1))
    def test_touching_boxes_stay_apart_for_any_order_and_indices(self, order: list[int], seed: int) -> None:
        vertices, faces = boxes(grid(2))
        turns = np.random.default_rng(seed).integers(0, 3, len(faces))
        turned = np.take_along_axis(faces, (np.arange(3) + turns[:, None]) % 3, axis=1)[order]
        soup = vertices[turned].reshape(-1, 3)
        component = connected_faces(soup, np.arange(len(soup)).reshape(-1, 3), np.zeros(len(turned), int))
        owner = np.array(order) // 12
        assert len({(int(a), int(b)) for a, b in zip(component, owner, strict=True)}) == 8
        assert component.max() == 7

    def test_every_solid_of_a_grid_is_closed(self, tmp_path: Path) -> None:
        import trimesh

        vertices, faces = boxes(grid(2))
        trimesh.Trimesh(vertices, faces, process=False).export(tmp_path / "m.stl")
        model = read_parts(tmp_path / "m.stl")
        assert len(model.parts) == 8
        assert [signed_volume(part.vertices, part.faces) for part in model.parts] == pytest.approx([1.0] * 8)

    def test_walls_that_meet_at_an_angle_in_one_edge_pair_up_by_their_insides(self) -> None:
        # four wedges around the z axis, seen from above like a cut cake: each a closed prism
        angles = np.linspace(0, 2 * np.pi, 5)
        wedges = []
        for begin, end in itertools.pairwise(angles):
            ring = np.array([[0, 0], [np.cos(begin), np.sin(begin)], [np.cos(end), np.sin(end)]]).round(6)
            wedges.append(np.vstack([np.column_stack([ring, np.zeros(3)]), np.column_stack([ring, np.ones(3)])]))
        prism = np.array([[0, 2, 1], [3, 4, 5], [0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4], [2, 0, 3], [2, 3, 5]])
        vertices = np.concatenate(wedges)
        faces = np.concatenate([prism + 6 * k for k in range(4)])
        component = connected_faces(vertices, faces, np.zeros(len(faces), int))
        np.testing.assert_array_equal(component, np.repeat(np.arange(4), 8))

    def test_repeated_solid_is_one_component(self) -> None:
        vertices, faces = boxes([box(), box()])
        assert connected_faces(vertices, faces, np.zeros(24, int)).max() == 0

    def test_kinds_are_never_joined(self) -> None:
        component = connected_faces(box(), BOX_FACES, np.arange(12) // 6)
        assert {tuple(np.unique(component[:6])), tuple(np.unique(component[6:]))} == {(0,), (1,)} or component.max() > 1
        assert not set(component[:6]) & set(component[6:])
