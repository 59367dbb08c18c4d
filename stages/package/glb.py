"""GLB files of shapes (glTF 2.0): one node per part, each mesh once, vertex colours.

The binary chunk of a mesh is built once for all shapes of a kit; a file concatenates chunks after a JSON of nodes.
Bytes depend only on the shape. There is no material: with one, trimesh and Hugging Face `datasets` drop vertex colours.
"""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from stages.shape.arrays import ByteArray
from stages.shape.kit import PartMesh
from stages.shape.shape import Shape

GL_FLOAT, GL_UNSIGNED_BYTE, GL_UNSIGNED_SHORT, GL_UNSIGNED_INT = 5126, 5121, 5123, 5125
ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER = 34962, 34963
ASSET = {"version": "2.0", "generator": "Shapemill"}


@dataclass(frozen=True)
class MeshChunk:
    """The binary chunk of a mesh.

    views: (offset, length, target) of positions, colours and indices
    accessors: the three glTF accessors without their views
    """

    name: str
    content: bytes
    views: tuple[tuple[int, int, int], ...]
    accessors: tuple[dict[str, Any], ...]


def glb_bytes(shape: Shape) -> bytes:
    """Return the GLB of a shape: named nodes in the order of the parts, and the meshes in use.

    Vertices are float32 in each mesh's own coordinates; nodes have 4x4 pose matrices. A node's `extras` has `class` and
    `instance`, the labels and instances of points.
    """
    chunks, assembly = _chunks(shape.meshes), shape.assembly
    used = sorted(set(assembly.types.tolist()))
    mesh_of = {index: mesh for mesh, index in enumerate(used)}
    content: list[bytes] = []
    views: list[dict[str, int]] = []
    accessors: list[dict[str, Any]] = []
    meshes: list[dict[str, Any]] = []
    start = 0
    for index in used:
        chunk = chunks[index]
        first = len(accessors)
        for (offset, length, target), accessor in zip(chunk.views, chunk.accessors, strict=True):
            views.append({"buffer": 0, "byteOffset": start + offset, "byteLength": length, "target": target})
            accessors.append({"bufferView": len(accessors), **accessor})
        attributes = {"POSITION": first, "COLOR_0": first + 1}
        primitive = {"attributes": attributes, "indices": first + 2}
        meshes.append({"name": chunk.name, "primitives": [primitive]})
        content.append(chunk.content)
        start += len(chunk.content)
    columns = assembly.poses.transpose(0, 2, 1).reshape(len(assembly), 16).tolist()
    nodes = [
        {"name": name, "mesh": mesh_of[kind], "matrix": matrix, "extras": {"class": label, "instance": instance}}
        for instance, (name, kind, label, matrix) in enumerate(
            zip(shape.part_names, assembly.types.tolist(), shape.part_classes.tolist(), columns, strict=True)
        )
    ]
    header = {
        "asset": ASSET,
        "scene": 0,
        "scenes": [{"nodes": list(range(len(nodes)))}],
        "nodes": nodes,
        "meshes": meshes,
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": start}],
    }
    return _container(header, b"".join(content))


@lru_cache(maxsize=16)
def _chunks(meshes: tuple[PartMesh, ...]) -> list[MeshChunk]:
    return [_chunk(mesh) for mesh in meshes]


def linear_colors(colors: ByteArray) -> ByteArray:
    """Convert sRGB uint8 (n, 3) to linear uint8 (n, 4) with full alpha: vertex colours of glTF are linear."""
    level = colors / 255.0
    linear = np.where(level <= 0.04045, level / 12.92, ((level + 0.055) / 1.055) ** 2.4)
    full = np.full((len(colors), 4), 255, dtype=np.uint8)
    full[:, :3] = np.rint(linear * 255.0)
    return full


def _chunk(mesh: PartMesh) -> MeshChunk:
    """Return the arrays of a mesh, with a vertex for each colour of its faces."""
    faces = mesh.faces.astype(np.int64)
    shades, shade_of_face = np.unique(mesh.face_colors, axis=0, return_inverse=True)
    coded = faces * len(shades) + shade_of_face.reshape(-1, 1)
    pairs, indices = np.unique(coded, return_inverse=True)
    positions = mesh.vertices[pairs // len(shades)].astype(np.float32)
    colors = linear_colors(shades[pairs % len(shades)])
    short = len(pairs) <= 65535
    flat = indices.reshape(-1).astype(np.uint16 if short else np.uint32)
    arrays = (
        (positions.tobytes(), ARRAY_BUFFER),
        (colors.tobytes(), ARRAY_BUFFER),
        (flat.tobytes(), ELEMENT_ARRAY_BUFFER),
    )
    content, views = b"", []
    for stored, target in arrays:
        views.append((len(content), len(stored), target))
        content += _padded(stored, b"\0")
    accessors: tuple[dict[str, Any], ...] = (
        {
            "componentType": GL_FLOAT,
            "count": len(pairs),
            "type": "VEC3",
            "min": positions.min(axis=0).tolist(),
            "max": positions.max(axis=0).tolist(),
        },
        {"componentType": GL_UNSIGNED_BYTE, "normalized": True, "count": len(pairs), "type": "VEC4"},
        {"componentType": GL_UNSIGNED_SHORT if short else GL_UNSIGNED_INT, "count": flat.size, "type": "SCALAR"},
    )
    return MeshChunk(mesh.name, content, tuple(views), accessors)


def _container(header: dict[str, Any], content: bytes) -> bytes:
    text = _padded(json.dumps(header, ensure_ascii=False, allow_nan=False, separators=(",", ":")).encode(), b" ")
    total = 12 + 8 + len(text) + 8 + len(content)
    return b"".join(
        (
            struct.pack("<4sII", b"glTF", 2, total),
            struct.pack("<I4s", len(text), b"JSON"),
            text,
            struct.pack("<I4s", len(content), b"BIN\0"),
            content,
        )
    )


def _padded(stored: bytes, filler: bytes) -> bytes:
    """Pad to a multiple of four bytes, as glTF requires."""
    return stored + filler * (-len(stored) % 4)
