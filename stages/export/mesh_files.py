"""The mesh files that URDF and MJCF refer to: each mesh once as it looks, and its convex collision piece."""

from __future__ import annotations

import re
from collections.abc import Mapping

from stages.export.model import SimulationModel
from stages.export.obj import material_bytes, mesh_bytes

MESH_FOLDER = "meshes"
MATERIALS = "materials.mtl"


def mesh_files(model: SimulationModel) -> Mapping[str, bytes]:
    """Return the mesh files of a model, by their paths below its folder."""
    used = {index: model.shape.meshes[index] for index in model.hulls}
    files = {f"{MESH_FOLDER}/{MATERIALS}": material_bytes(used.values())}
    for index, mesh in used.items():
        files[f"{MESH_FOLDER}/{mesh_stem(model, index)}.obj"] = mesh_bytes(mesh, MATERIALS)
        files[f"{MESH_FOLDER}/{hull_stem(model, index)}.obj"] = mesh_bytes(model.hulls[index], "")
    return files


def mesh_stem(model: SimulationModel, index: int) -> str:
    """Return the name of the file of a mesh, without suffix."""
    return f"{re.sub(r'[^A-Za-z0-9_-]', '_', model.shape.meshes[index].name)}-{index}"


def hull_stem(model: SimulationModel, index: int) -> str:
    """Return the name of the file of a mesh's collision piece, without suffix."""
    return f"{mesh_stem(model, index)}-hull"
