"""A model as its file has it, parts with rigid poses, and its way out of the process that has read the file."""

from __future__ import annotations

import io
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from stages.exemplars.segmentation import Segmentation
from stages.shape.arrays import ByteArray, FloatArray, IntArray

STATED_IN_CONFIG = "as the config says"
"""Why a model has the parts that it has where nobody looked for others."""


@dataclass(frozen=True)
class RawPart:
    """One part as the file has it.

    name: unique in the model. mesh_name: the mesh that the part places, equal exactly for parts that share one (and
    its scale); their arrays are then the same objects. label: the file's own word for the part's type, if any.
    pose: float64 (4, 4), rigid, determinant +1. vertices: float64 (v, 3) in part coordinates, the origin in the middle
    of the part's box; faces: int32 (f, 3); face_colors: uint8 (f, 3) sRGB.
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

    segmentation: the source of the parts, what `auto` picked; why: one sentence on that; warnings: one sentence each;
    up: the axis that points up by the file's own word, where its format lets files choose.
    """

    path: Path
    parts: tuple[RawPart, ...]
    segmentation: Segmentation
    why: str
    warnings: tuple[str, ...]
    up: Literal["y", "z"] | None = None

    @property
    def is_cut(self) -> bool:
        """Whether its parts are pieces that one surface was cut into: what meets there goes on."""
        return self.segmentation in ("symmetry", "sections")


def pack_model(model: Model) -> bytes:
    """A model without its path as bytes, which `unpack_model` reads: an npz file of plain arrays."""
    meshes = {each.mesh_name: each for each in model.parts}
    place = {name: index for index, name in enumerate(meshes)}
    said = {
        "parts": [[each.name, place[each.mesh_name], each.label] for each in model.parts],
        "meshes": list(meshes),
        "segmentation": model.segmentation,
        "why": model.why,
        "warnings": model.warnings,
        "up": model.up,
    }
    stream = io.BytesIO()
    np.savez(
        stream,
        said=np.frombuffer(json.dumps(said).encode(), np.uint8),
        poses=np.array([each.pose for each in model.parts], dtype=np.float64),
        sizes=np.array([[len(each.vertices), len(each.faces)] for each in meshes.values()], dtype=np.int64),
        vertices=np.concatenate([each.vertices for each in meshes.values()]),
        faces=np.concatenate([each.faces for each in meshes.values()]),
        face_colors=np.concatenate([each.face_colors for each in meshes.values()]),
    )
    return stream.getvalue()


def unpack_model(path: Path, content: bytes) -> Model:
    """The model that `pack_model` has packed, as that of the file `path`.

    Raises ValueError for arrays that are no meshes: a face of a vertex that is not there would be followed by compiled
    code to wherever it leads.
    """
    with np.load(io.BytesIO(content), allow_pickle=False) as stored:
        said: dict[str, Any] = json.loads(stored["said"].tobytes())
        poses, sizes = stored["poses"], stored["sizes"]
        vertices, faces, face_colors = stored["vertices"], stored["faces"], stored["face_colors"]
    last = sizes.cumsum(axis=0)
    meshes = []
    for (to_vertex, to_face), (vertex_count, face_count) in zip(last.tolist(), sizes.tolist(), strict=True):
        own = slice(to_face - face_count, to_face)
        mesh = vertices[to_vertex - vertex_count : to_vertex], faces[own], face_colors[own]
        if not len(mesh[1]) or mesh[1].min() < 0 or mesh[1].max() >= len(mesh[0]):
            raise ValueError("a face of a vertex that is not there")
        meshes.append(mesh)
    kinds = [each.dtype for each in (poses, vertices, faces, face_colors)]
    if kinds != [np.float64, np.float64, np.int32, np.uint8] or not (
        np.isfinite(poses).all() and np.isfinite(vertices).all()
    ):
        raise ValueError("arrays of other kinds, or numbers that are not finite")
    parts = [
        RawPart(name, said["meshes"][mesh], label, pose, *meshes[mesh])
        for (name, mesh, label), pose in zip(said["parts"], poses, strict=True)
    ]
    return Model(path, tuple(parts), said["segmentation"], said["why"], tuple(said["warnings"]), said["up"])
