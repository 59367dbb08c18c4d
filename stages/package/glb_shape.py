"""Decoding of a sample's GLB: the inverse of `glb_bytes`."""

from __future__ import annotations

import io
from typing import Any

import numpy as np

from stages.shape.kit import Assembly, PartMesh
from stages.shape.shape import Shape
from stages.shape.views.palette import linear_to_srgb


def glb_shape(content: bytes) -> Shape:
    """Return the parts in a sample's member `glb`: names, meshes, poses, and colours within 2 of 255; y up.

    The shape has no contacts: these are in the sample's `json`.
    """
    import trimesh

    scene = trimesh.load_scene(io.BytesIO(content), file_type="glb", process=False)
    names = sorted(scene.graph.nodes_geometry)
    placed = [scene.graph.get(name) for name in names]
    label_of = {geometry: name.rpartition(".")[0] or name for name, (_, geometry) in zip(names, placed, strict=True)}
    geometries = list(label_of)
    assembly = Assembly(
        types=np.array([geometries.index(geometry) for _, geometry in placed], dtype=np.int16),
        poses=np.array([pose for pose, _ in placed], dtype=np.float64),
        edges=np.empty((0, 2), dtype=np.int32),
    )
    meshes = tuple(_part_mesh(label_of[geometry], scene.geometry[geometry]) for geometry in geometries)
    return Shape(meshes, assembly, "y", tuple(dict.fromkeys(label_of.values())), tuple(names))


def _part_mesh(label: str, mesh: Any) -> PartMesh:
    # The file has a vertex for each of its colours, so the first corner of a face has the colour of the face.
    vertices, index = np.unique(np.asarray(mesh.vertices, dtype=np.float64), axis=0, return_inverse=True)
    faces = np.asarray(mesh.faces)
    linear = np.asarray(mesh.visual.vertex_colors, dtype=np.float64)[faces[:, 0], :3] / 255.0
    return PartMesh(label, vertices, index.reshape(-1)[faces].astype(np.int32), linear_to_srgb(linear))
