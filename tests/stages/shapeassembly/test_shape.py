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
from stages.shapeassembly.checks import violations
from stages.shapeassembly.shape import shape_of_text

EXAMPLES = sorted(Path("datasets/exemplars/programs").glob("*.txt"))


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_a_shipped_program_keeps_every_rule_and_its_meshes_are_its_cuboids(path: Path) -> None:
    text = path.read_text()
    program = parse(text)
    assert violations(program) == []
    done, shape = execute(program), shape_of_text(text)
    assert shape.part_names == done.names
    assert (shape.up, shape.labels) == ("y", ("cuboid",))
    for mesh, pose, corners, size in zip(shape.meshes, shape.assembly.poses, done.corners, done.sizes, strict=True):
        np.testing.assert_allclose(mesh.vertices @ pose[:3, :3].T + pose[:3, 3], corners, atol=1e-12)
        box = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
        assert box.is_watertight
        assert box.volume == pytest.approx(size.prod())


def test_nodes_of_the_mesh_file_are_named_by_path() -> None:
    shape = shape_of_text(next(path for path in EXAMPLES if path.stem == "wardrobe").read_text())
    stored = glb_bytes(shape)
    header = json.loads(stored[20 : 20 + struct.unpack("<I", stored[12:16])[0]])
    names = [node["name"] for node in header["nodes"]]
    assert len(names) == 11
    assert {"Wardrobe/plinth", "Wardrobe/Door/knob", "Wardrobe/cube3/knob"} <= set(names)
