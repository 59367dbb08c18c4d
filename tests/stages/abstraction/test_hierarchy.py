"""Shapes as part hierarchies: every part once, groups that hang together, boxes where the parts stand."""

from __future__ import annotations

import numpy as np
import pytest

from stages.abstraction.hierarchy import Boxes, part_hierarchy
from stages.shape.kit import Assembly, PartMesh
from stages.shape.shape import Shape
from stages.shapeassembly.extraction.boxes import bounding_box, box_gap, corners_of_box
from stages.shapeassembly.extraction.category_rules import CATEGORY_RULES
from stages.shapeassembly.extraction.extract import extract
from stages.shapeassembly.extraction.hierarchy import PartNode
from stages.shapeassembly.extraction.settings import Gates


def box(name: str, *size: float) -> PartMesh:
    import trimesh

    mesh = trimesh.creation.box(size)
    faces = np.asarray(mesh.faces, np.int32)
    return PartMesh(name, np.asarray(mesh.vertices, np.float64), faces, np.full((len(faces), 3), 90, np.uint8))


def shape_of(meshes: list[PartMesh], placed: list[tuple[int, np.ndarray]]) -> Shape:
    types = np.array([kind for kind, _ in placed], np.int16)
    assembly = Assembly(types, np.stack([pose for _, pose in placed]), np.empty((0, 2), np.int32))
    return Shape(tuple(meshes), assembly, "y", tuple(mesh.name for mesh in meshes))


def at(x: float, y: float, z: float, turn: float = 0.0) -> np.ndarray:
    """A pose: a turn about the upright axis, in degrees, and a shift."""
    cos, sin = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    return np.array([[cos, 0, sin, x], [0, 1, 0, y], [-sin, 0, cos, z], [0, 0, 0, 1]])


def towers(count: int, storeys: int) -> Shape:
    """Towers of cubes, side by side on a slab."""
    placed = [(0, at(0, -0.25, 0))]
    placed += [(1, at(2.0 * (n - (count - 1) / 2), 0.5 + level, 0)) for n in range(count) for level in range(storeys)]
    return shape_of([box("slab", 2.0 * count, 0.5, 2.0), box("cube", 1.0, 1.0, 1.0)], placed)


def nodes(part: PartNode) -> list[PartNode]:
    return [part, *(below for child in part.children for below in nodes(child))] if part.children else []


@pytest.mark.parametrize(("count", "storeys", "children"), [(4, 1, 9), (4, 5, 9), (6, 7, 5), (3, 4, 2)])
def test_every_part_is_one_leaf_and_assemblies_are_small_and_connected(count: int, storeys: int, children: int) -> None:
    shape = towers(count, storeys)
    root = part_hierarchy(shape, children, Boxes()).root
    leaves = list(root.leaves())
    assert sorted(leaf.label for leaf in leaves) == ["cube"] * (count * storeys) + ["slab"]
    centers = {tuple(np.round(leaf.box.center, 9)) for leaf in leaves}
    assert centers == {tuple(np.round(pose[:3, 3], 9)) for pose in shape.assembly.poses}
    for node in nodes(root):
        assert 2 <= len(node.children) <= children
        below = list(node.leaves())
        reached, edge = {0}, [0]
        while edge:
            here = edge.pop()
            near = [
                n for n in range(len(below)) if n not in reached and box_gap(below[here].box, below[n].box)[0] < 0.01
            ]
            reached.update(near)
            edge += near
        assert len(reached) == len(below)
        corners = np.concatenate([corners_of_box(leaf.box) for leaf in below])
        assert np.allclose(bounding_box(corners, np.eye(3)).size, node.box.size)


def test_a_box_turns_with_its_part_and_a_roof_stands_upright() -> None:
    post, roof = box("post", 0.2, 2.0, 0.2), box("roof", 1.0, 1.0, 1.0)
    pyramid = PartMesh("roof", roof.vertices * np.where(roof.vertices[:, 1:2] > 0, [[0.01, 1, 0.01]], 1.0), roof.faces,
                       roof.face_colors)  # fmt: skip
    boxes = Boxes()
    turned = corners_of_box(boxes.of(post, at(1, 2, 3, 30)))
    wanted = post.vertices @ at(0, 0, 0, 30)[:3, :3].T + [1, 2, 3]
    assert max(np.linalg.norm(turned - corner, axis=1).min() for corner in wanted) < 1e-9
    assert np.allclose(np.abs(boxes.of(pyramid, np.eye(4)).axes), np.eye(3))


def test_parts_that_do_not_touch_make_a_wider_node() -> None:
    shape = shape_of([box("cube", 1.0, 1.0, 1.0)], [(0, at(5.0 * n, 0, 0)) for n in range(6)])
    root = part_hierarchy(shape, 3, Boxes()).root
    assert len(root.children) == 6


def test_towers_on_a_slab_become_a_program_of_their_boxes() -> None:
    found = extract(
        part_hierarchy(towers(4, 3), 9, Boxes()), CATEGORY_RULES["any"], Gates(min_leaves=1, max_leaves=200)
    )
    assert found.f_score > 99
