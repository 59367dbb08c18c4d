"""`read_model`: placements, node tree, unit and up axis of every format."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline.errors import ConfigError
from stages.model_files.limits import ReadLimits
from stages.model_files.packing import pack_scene, unpack_scene
from stages.model_files.read import read_model
from stages.model_files.scene import GREY, ModelScene, Placement, SceneNode, Surface
from stages.model_files.scene_file import read_scene
from tests.hostile.good import write_good
from tests.stages.exemplars.model_files import BOX_FACES, Glb, box


def test_node_tree_holds_what_leads_to_a_mesh(tmp_path: Path) -> None:
    glb = Glb()
    mesh = glb.mesh(glb.primitive(box(), BOX_FACES))
    empty = glb.node(root=False, name="lamp")
    leg = glb.node(root=False, name="leg", mesh=mesh, translation=[0, 1, 0])
    legs = glb.node(root=False, name="legs", children=[empty, leg], translation=[2, 0, 0])
    glb.node(name="table", mesh=mesh, children=[legs])
    scene = read_model(glb.write(tmp_path / "m.glb"))
    assert scene.nodes == (SceneNode("table", -1), SceneNode("legs", 0), SceneNode("leg", 1))
    assert [(place.name, place.node) for place in scene.placements] == [("table", 0), ("leg", 2)]
    assert scene.placements[1].pose[:3, 3].tolist() == [2, 1, 0]
    assert scene.unit == 1.0


def test_scene_is_the_same_on_both_sides_of_the_process(tmp_path: Path) -> None:
    for path in write_good(tmp_path):
        here, there = read_scene(path), read_model(path, texture_size=4096)
        assert pack_scene(unpack_scene(pack_scene(here))[0]) == pack_scene(here)
        assert pack_scene(there) == pack_scene(here)
        assert (there.unit is None) == (path.suffix in (".obj", ".ply", ".stl", ".off"))


def test_more_parts_than_the_limit_are_refused(tmp_path: Path) -> None:
    glb = Glb()
    mesh = glb.mesh(glb.primitive(box(), BOX_FACES))
    for _ in range(3):
        glb.node(mesh=mesh)
    path = glb.write(tmp_path / "m.glb")
    with pytest.raises(ConfigError, match="has 3 parts and at most 2 are read"):
        read_model(path, ReadLimits(parts=2))


def test_faces_without_their_vertices_do_not_come_out_of_the_child() -> None:
    faces = BOX_FACES.copy()
    faces[0, 0] = 8
    surface = Surface("box", box(), faces, np.tile(np.array(GREY, np.uint8), (12, 1)))
    scene = ModelScene("objects", (surface,), (Placement("box", None, 0, np.eye(4)),))
    with pytest.raises(ValueError, match="does not exist"):
        unpack_scene(pack_scene(scene))
