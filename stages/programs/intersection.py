"""Intersection of parts, where no constraint prevents it (geocode §3.1)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stages.programs.curves.mesh import QuadMesh
from stages.programs.curves.part import Part
from stages.programs.program import Program
from stages.shape.arrays import FloatArray


def intersecting_labels(program: Program, parts: Sequence[Part]) -> tuple[str, str] | None:
    """The first pair of labels in `non_intersecting` with parts that intersect, or None."""
    for first, second in program.non_intersecting:
        for i, a in enumerate(parts):
            for j, b in enumerate(parts):
                is_pair = (a.label, b.label) == (first, second)
                if is_pair and (i < j or first != second) and meshes_intersect(a.mesh, b.mesh):
                    return first, second
    return None


def meshes_intersect(a: QuadMesh, b: QuadMesh, distance: float = 0.0) -> bool:
    """Whether two closed meshes come within `distance` of each other, or one contains the other."""
    low = np.maximum(a.bounds[0], b.bounds[0]) - distance
    high = np.minimum(a.bounds[1], b.bounds[1]) + distance
    if np.any(low > high):
        return False
    a_faces, b_faces = _faces_in_box(a, low, high), _faces_in_box(b, low, high)
    if len(a_faces) and len(b_faces) and _surfaces_intersect(a.vertices, a_faces, b.vertices, b_faces, distance):
        return True
    return _is_inside(a.vertices[0], b) or _is_inside(b.vertices[0], a)


def _surfaces_intersect(
    vertices: FloatArray, faces: np.ndarray, others: FloatArray, other_faces: np.ndarray, distance: float
) -> bool:
    from stages.shape.geometry.mesh_pairs import build_tree, first_contact

    return first_contact(build_tree(vertices, faces), build_tree(others, other_faces), np.eye(4), distance)


def _faces_in_box(mesh: QuadMesh, low: FloatArray, high: FloatArray) -> np.ndarray:
    """The triangles whose bounding boxes overlap the box from `low` to `high`, int32 (k, 3)."""
    lowest, highest = mesh.triangle_bounds
    overlapping = np.ones(len(lowest), dtype=bool)
    for axis in range(3):
        overlapping &= (lowest[:, axis] <= high[axis]) & (highest[:, axis] >= low[axis])
    faces: np.ndarray = mesh.triangles[overlapping]
    return faces


def _is_inside(point: FloatArray, mesh: QuadMesh) -> bool:
    """Whether a point is inside a closed surface, by the solid angle (van Oosterom and Strackee)."""
    if np.any(point < mesh.bounds[0]) or np.any(point > mesh.bounds[1]):
        return False
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] - point for k in range(3))
    x, y, z = (np.linalg.norm(corner, axis=1) for corner in (a, b, c))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c))
    denominator = x * y * z + (a * b).sum(axis=1) * z + (b * c).sum(axis=1) * x + (c * a).sum(axis=1) * y
    winding = np.arctan2(volume, denominator).sum() / (2 * np.pi)
    return bool(abs(winding) > 0.5)
