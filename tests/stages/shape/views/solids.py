"""Small solids, kits and scenes for tests of what is seen."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from stages.shape.kit import Assembly, Grammar, Kit, PartType
from stages.shape.shape import kit_shape
from stages.shape.views.scene import Scene, scene_of

EXEMPLARS = Path(__file__).resolve().parents[4].parent / "shared" / "exemplars"

BOX_CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
BOX_EDGES = [(i, j) for i in range(8) for j in range(i) if np.abs(BOX_CORNERS[i] - BOX_CORNERS[j]).sum() == 1.0]
BOX_QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]


def box(size=(1.0, 1.0, 1.0)):
    """Vertices and faces of a box around the origin."""
    faces = [(a, b, c) for a, b, c, _ in BOX_QUADS] + [(a, c, d) for a, _, c, d in BOX_QUADS]
    return BOX_CORNERS * np.array(size), np.array(faces, dtype=np.int32)


def cylinder(sides=64, radius=1.0, height=2.0):
    """Vertices and faces of an upright (y) cylinder with capped ends, no vertex shared between side and caps."""
    turn = 2 * np.pi * np.arange(sides) / sides
    ring = np.stack([radius * np.cos(turn), np.zeros(sides), radius * np.sin(turn)], axis=1)
    lift = np.array([0.0, height / 2, 0.0])
    low, high = ring - lift, ring + lift
    vertices = np.concatenate([low, high, low, high])
    faces = []
    for k in range(sides):
        n = (k + 1) % sides
        faces += [(k, sides + k, n), (n, sides + k, sides + n)]
        if 0 < k < sides - 1:
            faces += [(2 * sides, 2 * sides + k, 2 * sides + n), (3 * sides, 3 * sides + n, 3 * sides + k)]
    return vertices, np.array(faces, dtype=np.int32)


def part_type(name, mesh, color=(180, 120, 90)):
    """A part type with one colour."""
    vertices, faces = mesh
    colors = np.full((len(faces), 3), color, dtype=np.uint8)
    return PartType(name, vertices.astype(np.float64), faces, colors, np.eye(4), np.eye(4)[None])


def kit_of(*types, up="y"):
    """A kit without exemplars."""
    return Kit(
        name="solids",
        types=tuple(types),
        exemplars=(),
        grammar=Grammar(neighbourhoods={}, dockings=(), nested={}),
        contact_tolerance=1e-3,
        pose_tolerance=1e-3,
        contact_kinds=("point", "line", "face"),
        up=up,
    )


def posed(*offsets):
    """Poses that only move."""
    poses = np.tile(np.eye(4), (len(offsets), 1, 1))
    poses[:, :3, 3] = offsets
    return poses


def boxes_scene(offsets, sizes=None, edges=(), up="y"):
    """A scene of boxes, each a type of its own."""
    sizes = [(1.0, 1.0, 1.0)] * len(offsets) if sizes is None else sizes
    kit = kit_of(*(part_type(f"box{k}", box(size)) for k, size in enumerate(sizes)), up=up)
    contacts = np.array(edges, dtype=np.int32).reshape(-1, 2)
    return scene_of(kit_shape(kit, Assembly(np.arange(len(offsets), dtype=np.int16), posed(*offsets), contacts)))


def exemplar_scene(name) -> Scene:
    """A real exemplar as it stands in its file; skips the test if it is missing."""
    import trimesh

    folder = EXEMPLARS / name
    if not folder.is_dir():
        pytest.skip("no real exemplars here")
    loaded = trimesh.load(folder / "model.glb", process=False)
    listed = json.loads((folder / "exemplar.json").read_text(encoding="utf-8"))
    types, index, poses = [], [], []
    known = {}
    for part in listed["part_list"]:
        pose, geometry = loaded.graph[part["node"]]
        if geometry not in known:
            known[geometry] = len(types)
            mesh = loaded.geometry[geometry]
            types.append(part_type(geometry, (np.asarray(mesh.vertices), np.asarray(mesh.faces, dtype=np.int32))))
        index.append(known[geometry])
        poses.append(pose)
    contacts = np.array([edge[:2] for edge in listed["edge_list"]], dtype=np.int32).reshape(-1, 2)
    assembly = Assembly(np.array(index, dtype=np.int16), np.array(poses), contacts)
    return scene_of(kit_shape(kit_of(*types), assembly))
