"""GLB files of shapes (glTF 2.0): one node a part, each mesh once, colours at the vertices.

The binary part of a mesh never changes, so it is built once for all shapes of a kit; a file is these parts put one
behind another and a JSON of nodes. Bytes depend on the shape alone. There is no material: trimesh, and with it
Hugging Face `datasets`, drops vertex colours where there is one.
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

FLOAT, UNSIGNED_BYTE, UNSIGNED_SHORT, UNSIGNED_INT = 5126, 5121, 5123, 5125
ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER = 34962, 34963
ASSET = {"version": "2.0", "generator": "Shapemill"}


@dataclass(frozen=True)
class MeshChunk:
    """One mesh as it stands in a file: `content`, and where in it which array lies.

    views: `(offset, length, target)` of positions, colours and indices; accessors: the three glTF accessors without
    their views.
    """

    name: str
    content: bytes
    views: tuple[tuple[int, int, int], ...]
    accessors: tuple[dict[str, Any], ...]


def glb_bytes(shape: Shape) -> bytes:
    """The GLB of `shape`: nodes in the order of the parts, with their names; only meshes in use.

    Vertices stay in each mesh's own coordinates as float32; the poses stand in the nodes as 4x4 matrices. Each
    node's `extras` has `class` and `instance`, what labels and instances of points refer to.
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
    return [_chunk(each) for each in meshes]


def linear_colors(colors: ByteArray) -> ByteArray:
    """sRGB uint8 (n, 3) as linear uint8 (n, 4) with full alpha: vertex colours of glTF are linear."""
    level = colors / 255.0
    linear = np.where(level <= 0.04045, level / 12.92, ((level + 0.055) / 1.055) ** 2.4)
    full = np.full((len(colors), 4), 255, dtype=np.uint8)
    full[:, :3] = np.rint(linear * 255.0)
    return full


def _chunk(mesh: PartMesh) -> MeshChunk:
    """The arrays of a mesh: a vertex stands once for each colour that its faces have, so that faces keep theirs."""
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
            "componentType": FLOAT,
            "count": len(pairs),
            "type": "VEC3",
            "min": positions.min(axis=0).tolist(),
            "max": positions.max(axis=0).tolist(),
        },
        {"componentType": UNSIGNED_BYTE, "normalized": True, "count": len(pairs), "type": "VEC4"},
        {"componentType": UNSIGNED_SHORT if short else UNSIGNED_INT, "count": flat.size, "type": "SCALAR"},
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
    """`stored`, filled up to a multiple of four bytes as glTF asks."""
    return stored + filler * (-len(stored) % 4)
