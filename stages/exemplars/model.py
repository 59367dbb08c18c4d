"""A model as read from its file, and its serialization out of the process that read the file."""

from __future__ import annotations

import io
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from stages.exemplars.settings import Segmentation
from stages.shape.arrays import ByteArray, FloatArray, IntArray

STATED_IN_CONFIG = "as the config says"
"""Why a model has its parts if the config states their source."""


@dataclass(frozen=True)
class RawPart:
    """One part as read from a file.

    name: unique in the model.
    mesh_name: equal exactly for parts that share a mesh and its scale; their arrays are then the same objects.
    label: the file's label for the part's type, if any.
    pose: float64 (4, 4), rigid, determinant +1.
    vertices: float64 (v, 3) in part coordinates, the origin in the middle of the part's box.
    faces: int32 (f, 3).
    face_colors: uint8 (f, 3) sRGB.
    """

    name: str
    mesh_name: str
    label: str | None
    pose: FloatArray
    vertices: FloatArray
    faces: IntArray
    face_colors: ByteArray


@dataclass(frozen=True)
class Model:
    """The parts of a model file in the file's order.

    segmentation: the source of the parts, what `auto` picked.
    why: the reason, a sentence.
    warnings: a sentence each.
    up: the axis that points up as the file states it, if its format lets files choose.
    """

    path: Path
    parts: tuple[RawPart, ...]
    segmentation: Segmentation
    why: str
    warnings: tuple[str, ...]
    up: Literal["y", "z"] | None = None

    @property
    def is_cut(self) -> bool:
        """Whether its parts are pieces of one surface, which continues across their contacts."""
        return self.segmentation in ("symmetry", "sections")


def pack_model(model: Model) -> bytes:
    """Return a model without its path as an npz file of plain arrays, which `unpack_model` reads."""
    meshes = {part.mesh_name: part for part in model.parts}
    index_of = {name: index for index, name in enumerate(meshes)}
    header = {
        "parts": [[part.name, index_of[part.mesh_name], part.label] for part in model.parts],
        "meshes": list(meshes),
        "segmentation": model.segmentation,
        "why": model.why,
        "warnings": model.warnings,
        "up": model.up,
    }
    stream = io.BytesIO()
    np.savez(
        stream,
        header=np.frombuffer(json.dumps(header).encode(), np.uint8),
        poses=np.array([part.pose for part in model.parts], dtype=np.float64),
        sizes=np.array([[len(mesh.vertices), len(mesh.faces)] for mesh in meshes.values()], dtype=np.int64),
        vertices=np.concatenate([mesh.vertices for mesh in meshes.values()]),
        faces=np.concatenate([mesh.faces for mesh in meshes.values()]),
        face_colors=np.concatenate([mesh.face_colors for mesh in meshes.values()]),
    )
    return stream.getvalue()


def unpack_model(path: Path, content: bytes) -> Model:
    """Return the model that `pack_model` has packed, as that of the file `path`.

    Raises ValueError for arrays that are no meshes: compiled code would follow a missing vertex out of bounds.
    """
    with np.load(io.BytesIO(content), allow_pickle=False) as stored:
        header: dict[str, Any] = json.loads(stored["header"].tobytes())
        poses, sizes = stored["poses"], stored["sizes"]
        vertices, faces, face_colors = stored["vertices"], stored["faces"], stored["face_colors"]
    last = sizes.cumsum(axis=0)
    meshes = []
    for (to_vertex, to_face), (vertex_count, face_count) in zip(last.tolist(), sizes.tolist(), strict=True):
        own = slice(to_face - face_count, to_face)
        mesh = vertices[to_vertex - vertex_count : to_vertex], faces[own], face_colors[own]
        if not len(mesh[1]) or mesh[1].min() < 0 or mesh[1].max() >= len(mesh[0]):
            raise ValueError("a face has a vertex that does not exist")
        meshes.append(mesh)
    dtypes = [array.dtype for array in (poses, vertices, faces, face_colors)]
    if dtypes != [np.float64, np.float64, np.int32, np.uint8] or not (
        np.isfinite(poses).all() and np.isfinite(vertices).all()
    ):
        raise ValueError("arrays have other types, or numbers that are not finite")
    parts = [
        RawPart(name, header["meshes"][mesh], label, pose, *meshes[mesh])
        for (name, mesh, label), pose in zip(header["parts"], poses, strict=True)
    ]
    return Model(path, tuple(parts), header["segmentation"], header["why"], tuple(header["warnings"]), header["up"])
