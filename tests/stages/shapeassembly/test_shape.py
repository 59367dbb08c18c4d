"""Programs as shapes: closed boxes in place, one node a cuboid, named by path."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh

from stages.package.glb import glb_bytes
from stages.shapeassembly import execute, parse
from stages.shapeassembly.shape import category_label_colors, shape_of_program_text
from stages.shapeassembly.syntax.checks import violations

EXAMPLES = sorted(Path("datasets/exemplars/programs").glob("*.txt"))


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_a_shipped_program_keeps_every_rule_and_its_meshes_are_its_cuboids(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    program = parse(text)
    assert violations(program) == []
    done, shape = execute(program), shape_of_program_text(text)
    assert shape.part_names == done.names
    assert shape.up == "y"
    assert [shape.labels[label] for label in shape.part_labels] == list(done.labels)
    assert list(shape.labels) == sorted(set(done.labels))
    for mesh, pose, corners, size in zip(shape.meshes, shape.assembly.poses, done.corners, done.sizes, strict=True):
        np.testing.assert_allclose(mesh.vertices @ pose[:3, :3].T + pose[:3, 3], corners, atol=1e-12)
        box = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
        assert box.is_watertight
        assert box.volume == pytest.approx(size.prod())


def test_nodes_of_the_mesh_file_are_named_by_path() -> None:
    shape = shape_of_program_text(
        next(path for path in EXAMPLES if path.stem == "wardrobe").read_text(encoding="utf-8")
    )
    stored = glb_bytes(shape)
    header = json.loads(stored[20 : 20 + struct.unpack("<I", stored[12:16])[0]])
    names = [node["name"] for node in header["nodes"]]
    assert len(names) == 11
    assert {"Wardrobe/plinth", "Wardrobe/Door/knob", "Wardrobe/cube3/knob"} <= set(names)


def labelled(stem: str) -> dict[str, str]:
    """The label of each part of a shipped program, by the part's name."""
    shape = shape_of_program_text(next(path for path in EXAMPLES if path.stem == stem).read_text(encoding="utf-8"))
    assert len(set(shape.part_names)) == len(shape)
    return dict(zip(shape.part_names, (shape.labels[label] for label in shape.part_labels), strict=True))


def test_a_copy_is_labelled_like_what_it_is_a_copy_of() -> None:
    armchair = labelled("armchair")
    assert armchair["Armchair/cube4"] == armchair["Armchair/arm"] == "Armchair/arm"
    assert armchair["Armchair/Feet/cube2"] == "Armchair/Feet/front_foot"
    assert armchair["Armchair/Feet/cube3"] == "Armchair/Feet/back_foot"
    shelves = [label for label in labelled("bookcase").values() if label == "Bookcase/shelf"]
    assert len(shelves) == 6


def test_a_part_of_a_copied_assembly_is_labelled_like_the_part_of_the_original() -> None:
    desk = labelled("desk")
    copies = {name: label for name, label in desk.items() if name.endswith("/panel") and name != "Desk/panel"}
    assert len(copies) == 3
    assert set(copies.values()) == {"Desk/Drawers/Front/panel"}
    assert desk["Desk/panel"] == "Desk/panel"


def test_a_copy_of_a_copy_is_labelled_like_the_first() -> None:
    text = """Assembly Shelf {
        bbox = Cuboid(1.0, 1.0, 1.0, True)
        post = Cuboid(0.1, 1.0, 0.1, True)
        squeeze(post, bbox, bbox, top, 0.1, 0.1)
        reflect(post, X)
        reflect(cube1, Z)
    }"""
    shape = shape_of_program_text(text)
    assert shape.part_names == ("Shelf/post", "Shelf/cube1", "Shelf/cube2")
    assert shape.labels == ("Shelf/post",)
    assert shape.part_labels.tolist() == [0, 0, 0]


def test_a_shape_has_the_labels_of_its_category_where_they_are_given() -> None:
    text = next(path for path in EXAMPLES if path.stem == "stool-tripod").read_text(encoding="utf-8")
    own, given = (
        shape_of_program_text(text),
        shape_of_program_text(text, ("Bed/leg", "Stool/back_leg", "Stool/leg", "Stool/seat")),
    )
    assert own.labels == ("Stool/back_leg", "Stool/leg", "Stool/seat")
    assert (given.part_labels == own.part_labels + 1).all()
    for mesh, label in zip(given.meshes, given.part_labels.tolist(), strict=True):
        assert (mesh.face_colors == category_label_colors(4)[label]).all()
