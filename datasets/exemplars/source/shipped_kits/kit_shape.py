"""An example shape: part types, poses of their parts, and its GLB file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from shipped_kits.solids import Solid, rotation
from stages.model_files.colors import linear_from_srgb
from stages.shape.arrays import FloatArray

if TYPE_CHECKING:
    import trimesh


@dataclass
class KitShape:
    """Parts on a lattice.

    types: solids by type name
    placed: type name and pose float64 (4, 4) of each part, in order
    """

    types: Mapping[str, Solid]
    placed: list[tuple[str, FloatArray]] = field(default_factory=list)

    def put(self, name: str, x: float, y: float, z: float, turn: float = 0.0) -> None:
        """Add a part of type `name` at (x, y, z), turned about the up axis by `turn` degrees."""
        if name not in self.types:
            raise KeyError(name)
        pose = np.eye(4)
        pose[:3, :3] = rotation(turn, "y")
        pose[:3, 3] = np.round([x, y, z], 9) + 0.0
        self.placed.append((name, pose))


def glb_bytes(shape: KitShape) -> bytes:
    """Return the shape as GLB, Y up: one node per part, named `<type>.<nnn>`, one mesh per type.

    COLOR_0 is linear, as in glTF. Corners are shared only between triangles of one colour, so colours stay crisp. There
    are no normals, which glTF reads as flat shading.
    """
    import trimesh

    scene = trimesh.Scene()
    counts: dict[str, int] = {}
    for name, pose in shape.placed:
        node = f"{name}.{counts.get(name, 0):03d}"
        if name not in counts:
            scene.add_geometry(_mesh(shape.types[name]), node_name=node, geom_name=name, transform=pose)
        else:
            scene.graph.update(node, matrix=pose, geometry=name)
        counts[name] = counts.get(name, 0) + 1
    exported = scene.export(file_type="glb")
    assert isinstance(exported, bytes)
    return exported


def _mesh(solid: Solid) -> trimesh.Trimesh:
    import trimesh

    vertices, faces, colors = solid.mesh()
    linear = np.rint(255.0 * linear_from_srgb(colors)).astype(np.uint8)
    corners = np.column_stack([vertices[faces.ravel()], np.repeat(linear, 3, axis=0)])
    _, first, inverse = np.unique(corners, axis=0, return_index=True, return_inverse=True)
    rgba = np.column_stack([corners[first, 3:], np.full(len(first), 255)]).astype(np.uint8)
    return trimesh.Trimesh(corners[first, :3], inverse.reshape(-1, 3), vertex_colors=rgba, process=False)
