"""Decoding of a sample's GLB: the inverse of `glb_bytes`."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from stages.model_files.enclosure import Enclosure
from stages.model_files.gltf import read_gltf
from stages.model_files.scene import Surface
from stages.shape.kit import Assembly, PartMesh
from stages.shape.shape import Shape


def glb_shape(content: bytes) -> Shape:
    """Return the parts in a sample's member `glb`: names, meshes, poses, looks, and colours within 2 of 255; y up.

    The shape has no contacts: these are in the sample's `json`.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "sample.glb"
        path.write_bytes(content)
        scene = read_gltf(path, Enclosure(path))
    label_of: dict[int, str] = {}
    for placement in scene.placements:
        label_of.setdefault(placement.surface, placement.name.rpartition(".")[0] or placement.name)
    assembly = Assembly(
        types=np.array([placement.surface for placement in scene.placements], dtype=np.int16),
        poses=np.array([placement.pose for placement in scene.placements], dtype=np.float64),
        edges=np.empty((0, 2), dtype=np.int32),
    )
    meshes = tuple(_part_mesh(label_of[number], surface) for number, surface in enumerate(scene.surfaces))
    names = tuple(placement.name for placement in scene.placements)
    return Shape(meshes, assembly, "y", tuple(dict.fromkeys(label_of.values())), names)


def _part_mesh(label: str, surface: Surface) -> PartMesh:
    # The file has a vertex for each of its colours and texture coordinates.
    vertices, index = np.unique(surface.vertices, axis=0, return_inverse=True)
    faces = index.reshape(-1)[surface.faces].astype(np.int32)
    return PartMesh(label, vertices, faces, surface.face_colors, appearance=surface.appearance)
