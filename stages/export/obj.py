"""Wavefront OBJ with materials: one object a part, y up, in the coordinates of the dataset."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from stages.shape.arrays import ByteArray, FloatArray
from stages.shape.geometry.pose import transform_points
from stages.shape.kit import PartMesh
from stages.shape.shape import Shape


def obj_files(name: str, shape: Shape) -> Mapping[str, bytes]:
    """Return the OBJ of a shape and its materials, by file name."""
    lines, first = [f"mtllib {name}.mtl"], 1
    for part, kind, pose in zip(shape.part_names, shape.assembly.types.tolist(), shape.assembly.poses, strict=True):
        mesh = shape.meshes[kind]
        lines += [f"o {_word(part)}", *_geometry(transform_points(pose, mesh.vertices), mesh, first)]
        first += len(mesh.vertices)
    used = [shape.meshes[kind] for kind in sorted(set(shape.assembly.types.tolist()))]
    return {f"{name}.obj": _text(lines), f"{name}.mtl": material_bytes(used)}


def mesh_bytes(mesh: PartMesh, materials: str) -> bytes:
    """Return a mesh in its own coordinates as OBJ; `materials` is the file of its materials, or empty."""
    if materials:
        return _text([f"mtllib {materials}", *_geometry(mesh.vertices, mesh, 1)])
    return _text([*_vertices(mesh.vertices), *_faces(mesh, np.arange(len(mesh.faces)), 1)])


def material_bytes(meshes: Iterable[PartMesh]) -> bytes:
    """Return the materials of meshes: one for each colour."""
    colors = sorted({color for mesh in meshes for color in map(tuple, np.unique(mesh.face_colors, axis=0).tolist())})
    lines: list[str] = []
    for color in colors:
        lines += [f"newmtl {_material(color)}", "Kd " + " ".join(f"{level / 255:.6g}" for level in color)]
    return _text(lines)


def main_color(mesh: PartMesh) -> tuple[float, ...]:
    """Return the colour of most faces, sRGB from 0 to 1."""
    colors, counts = np.unique(mesh.face_colors, axis=0, return_counts=True)
    return tuple((colors[counts.argmax()] / 255).tolist())


def _geometry(vertices: FloatArray, mesh: PartMesh, first: int) -> list[str]:
    lines = _vertices(vertices)
    colors, color_of = np.unique(mesh.face_colors, axis=0, return_inverse=True)
    for index, color in enumerate(colors.tolist()):
        lines += [f"usemtl {_material(color)}", *_faces(mesh, np.flatnonzero(color_of.reshape(-1) == index), first)]
    return lines


def _vertices(vertices: FloatArray) -> list[str]:
    return [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in vertices.tolist()]


def _faces(mesh: PartMesh, rows: np.ndarray, first: int) -> list[str]:
    return [f"f {a} {b} {c}" for a, b, c in (mesh.faces[rows].astype(np.int64) + first).tolist()]


def _material(color: Iterable[int] | ByteArray) -> str:
    return "color-" + "".join(f"{level:02x}" for level in color)


def _word(name: str) -> str:
    """Return a name without white space, at which readers of OBJ end it."""
    return "_".join(name.split())


def _text(lines: Iterable[str]) -> bytes:
    return ("\n".join(lines) + "\n").encode()
