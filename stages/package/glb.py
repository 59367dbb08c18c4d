"""GLB files of shapes (glTF 2.0): one node per part, each mesh once, materials with textures or vertex colours.

The binary chunk of a mesh is built once for all shapes of a kit; a file concatenates chunks after a JSON of nodes.
Bytes depend only on the shape. The faces of one material are one primitive. Faces without material have vertex colours
and no material: with one, trimesh and Hugging Face `datasets` drop vertex colours.
"""

from __future__ import annotations

import json
import struct
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from stages.package.glb_materials import MaterialTable
from stages.shape.appearance import NO_MATERIAL, Appearance, Material
from stages.shape.arrays import ByteArray, Float32Array, FloatArray
from stages.shape.kit import PartMesh, PartType
from stages.shape.shape import Shape

GL_FLOAT, GL_UNSIGNED_BYTE, GL_UNSIGNED_SHORT, GL_UNSIGNED_INT = 5126, 5121, 5123, 5125
ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER = 34962, 34963
ASSET = {"version": "2.0", "generator": "Shapemill"}


@dataclass(frozen=True)
class Primitive:
    """The faces of a mesh with one material.

    attributes: index of the accessor of each attribute in the chunk
    indices: index of the accessor of corners
    """

    attributes: dict[str, int]
    indices: int
    material: Material | None


@dataclass(frozen=True)
class MeshChunk:
    """The binary chunk of a mesh.

    views: (offset, length, target) of each accessor
    accessors: glTF accessors without their views
    """

    name: str
    content: bytes
    views: tuple[tuple[int, int, int], ...]
    accessors: tuple[dict[str, Any], ...]
    primitives: tuple[Primitive, ...]

    @cached_property
    def arrays(self) -> tuple[tuple[bytes, str], ...]:
        """The bytes of each accessor, and what tells them apart from equal bytes with another meaning."""
        return tuple(
            (padded(self.content[offset : offset + length], b"\0"), json.dumps([target, accessor]))
            for (offset, length, target), accessor in zip(self.views, self.accessors, strict=True)
        )


def glb_bytes(shape: Shape, hierarchy: Mapping[str, Any] | None = None) -> bytes:
    """Return the GLB of a shape: named nodes in the order of the parts, and the meshes in use.

    hierarchy: groups of the parts, as in the record; several are nodes, after those of the parts and above them

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
    table = MaterialTable()
    start = 0
    # Looks of a type share their arrays of positions, normals and corners.
    looks = Counter(id(mesh.vertices) for mesh in map(shape.meshes.__getitem__, used) if isinstance(mesh, PartType))
    known: dict[tuple[int, bytes, str], int] = {}
    for index in used:
        chunk, surface = chunks[index], id(shape.meshes[index].vertices)
        places: list[int] = []
        for (_, length, target), accessor, array in zip(chunk.views, chunk.accessors, chunk.arrays, strict=True):
            key = surface, *array
            if key in known:
                places.append(known[key])
                continue
            if looks[surface] > 1:
                known[key] = len(accessors)
            places.append(len(accessors))
            views.append({"buffer": 0, "byteOffset": start, "byteLength": length, "target": target})
            accessors.append({"bufferView": len(accessors), **accessor})
            content.append(array[0])
            start += len(array[0])
        primitives: list[dict[str, Any]] = []
        for primitive in chunk.primitives:
            attributes = {name: places[accessor] for name, accessor in primitive.attributes.items()}
            primitives.append({"attributes": attributes, "indices": places[primitive.indices]})
            if primitive.material is not None:
                primitives[-1]["material"] = table.index(primitive.material)
        meshes.append({"name": chunk.name, "primitives": primitives})
    for image in table.image_files:
        views.append({"buffer": 0, "byteOffset": start, "byteLength": len(image)})
        content.append(padded(image, b"\0"))
        start += len(content[-1])
    columns = assembly.poses.transpose(0, 2, 1).reshape(len(assembly), 16).tolist()
    nodes = [
        {"name": name, "mesh": mesh_of[kind], "matrix": matrix, "extras": {"class": label, "instance": instance}}
        for instance, (name, kind, label, matrix) in enumerate(
            zip(shape.part_names, assembly.types.tolist(), shape.part_classes.tolist(), columns, strict=True)
        )
    ]
    tops = list(range(len(nodes)))
    if hierarchy is not None and len(hierarchy["groups"]) > 1:
        tops = [len(nodes)]
        nodes += _group_nodes(hierarchy)
    header = {
        "asset": ASSET,
        "scene": 0,
        "scenes": [{"nodes": tops}],
        "nodes": nodes,
        "meshes": meshes,
        **table.header(first_view=len(accessors)),
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": start}],
    }
    return _container(header, b"".join(content))


def _group_nodes(hierarchy: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return a node for each group, without a place of its own, with its parts and then its groups."""
    groups, part_groups = hierarchy["groups"], hierarchy["part_groups"]
    children: list[list[int]] = [[] for _ in groups]
    for part, group in enumerate(part_groups):
        children[group].append(part)
    for index, group in enumerate(groups[1:], 1):
        children[group["parent"]].append(len(part_groups) + index)
    return [
        {"name": f"group {index} {group['name']}", "children": below}
        for index, (group, below) in enumerate(zip(groups, children, strict=True))
    ]


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
    """Return the arrays of a mesh, by material if it has an appearance."""
    packer = _Packer()
    if mesh.appearance is None:
        packer.add_colored(mesh, np.arange(len(mesh.faces)), None)
    else:
        for number in np.unique(mesh.appearance.face_material).tolist():
            faces = np.flatnonzero(mesh.appearance.face_material == number)
            if number == NO_MATERIAL:
                packer.add_colored(mesh, faces, mesh.appearance.normals)
            else:
                packer.add_textured(mesh, faces, mesh.appearance, mesh.appearance.materials[number])
    return MeshChunk(
        mesh.name, b"".join(packer.content), tuple(packer.views), tuple(packer.accessors), tuple(packer.primitives)
    )


class _Packer:
    """Collects the primitives of a mesh."""

    def __init__(self) -> None:
        self.content: list[bytes] = []
        self.views: list[tuple[int, int, int]] = []
        self.accessors: list[dict[str, Any]] = []
        self.primitives: list[Primitive] = []
        self._length = 0

    def add_colored(self, mesh: PartMesh, faces: np.ndarray, normals: Float32Array | None) -> None:
        """Add faces with a vertex for each colour around it, and for each normal."""
        shades, shade_of_face = np.unique(mesh.face_colors[faces], axis=0, return_inverse=True)
        coded = mesh.faces[faces].astype(np.int64) * len(shades) + shade_of_face.reshape(-1, 1)
        if normals is None:
            pairs, indices = np.unique(coded, return_inverse=True)
            own_normals = None
        else:
            first, indices = _distinct_rows([coded.reshape(-1, 1), normals[faces].reshape(-1, 3)])
            pairs, own_normals = coded.reshape(-1)[first], normals[faces].reshape(-1, 3)[first]
        attributes = {"POSITION": self._add_positions(mesh.vertices[pairs // len(shades)])}
        if own_normals is not None:
            attributes["NORMAL"] = self._add_floats(own_normals)
        colors = linear_colors(shades[pairs % len(shades)])
        kind = {"componentType": GL_UNSIGNED_BYTE, "normalized": True, "count": len(pairs), "type": "VEC4"}
        attributes["COLOR_0"] = self._add(colors.tobytes(), ARRAY_BUFFER, kind)
        self._finish(attributes, indices, len(pairs), None)

    def add_textured(self, mesh: PartMesh, faces: np.ndarray, look: Appearance, material: Material) -> None:
        """Add the faces of a material with a vertex for each texture coordinate and normal."""
        corners = mesh.faces[faces].reshape(-1)
        rows = [corners.reshape(-1, 1)]
        normals = None if look.normals is None else look.normals[faces].reshape(-1, 3)
        uv = None if look.uv is None or not material.textures else look.uv[faces].reshape(-1, 2)
        rows += [values for values in (normals, uv) if values is not None]
        first, indices = _distinct_rows(rows)
        attributes = {"POSITION": self._add_positions(mesh.vertices[corners[first]])}
        if normals is not None:
            attributes["NORMAL"] = self._add_floats(normals[first])
        if uv is not None:
            attributes["TEXCOORD_0"] = self._add_floats(uv[first])
        self._finish(attributes, indices, len(first), material)

    def _add_positions(self, vertices: FloatArray) -> int:
        positions = vertices.astype(np.float32)
        number = self._add_floats(positions)
        self.accessors[number] |= {"min": positions.min(axis=0).tolist(), "max": positions.max(axis=0).tolist()}
        return number

    def _add_floats(self, values: Float32Array) -> int:
        kind = {"componentType": GL_FLOAT, "count": len(values), "type": f"VEC{values.shape[1]}"}
        return self._add(values.tobytes(), ARRAY_BUFFER, kind)

    def _finish(
        self, attributes: dict[str, int], indices: np.ndarray, vertices: int, material: Material | None
    ) -> None:
        short = vertices <= 65535
        flat = indices.reshape(-1).astype(np.uint16 if short else np.uint32)
        kind = {
            "componentType": GL_UNSIGNED_SHORT if short else GL_UNSIGNED_INT,
            "count": flat.size,
            "type": "SCALAR",
        }
        self.primitives.append(Primitive(attributes, self._add(flat.tobytes(), ELEMENT_ARRAY_BUFFER, kind), material))

    def _add(self, stored: bytes, target: int, accessor: dict[str, Any]) -> int:
        """Add an array; return the number of its accessor."""
        self.views.append((self._length, len(stored), target))
        self.content.append(padded(stored, b"\0"))
        self._length += len(self.content[-1])
        self.accessors.append(accessor)
        return len(self.accessors) - 1


def _distinct_rows(columns: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Return the first of each group of equal rows of (n, k) columns, ascending, and the group of each row."""
    rows = np.concatenate([values.astype(np.float64) + 0.0 for values in columns], axis=1)
    _, first, inverse = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty(len(order), dtype=np.int64)
    rank[order] = np.arange(len(order))
    return first[order], rank[inverse.reshape(-1)]


def _container(header: dict[str, Any], content: bytes) -> bytes:
    text = padded(json.dumps(header, ensure_ascii=False, allow_nan=False, separators=(",", ":")).encode(), b" ")
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


def padded(stored: bytes, filler: bytes) -> bytes:
    """Pad to a multiple of four bytes, as glTF requires."""
    return stored + filler * (-len(stored) % 4)
