"""Intersection of parts, for shapes whose parameters no rule keeps apart (geocode §3.1)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stages.programs.curves.mesh import QuadMesh
from stages.programs.curves.part import Part
from stages.programs.program import Program
from stages.shape.arrays import FloatArray


def intersecting_labels(program: Program, parts: Sequence[Part]) -> tuple[str, str] | None:
    """The first pair of labels that shall stay apart and do not, or None."""
    for first, second in program.non_intersecting:
        for i, a in enumerate(parts):
            for j, b in enumerate(parts):
                wanted = (a.label, b.label) == (first, second)
                if wanted and (i < j or first != second) and meshes_intersect(a.mesh, b.mesh):
                    return first, second
    return None


def meshes_intersect(a: QuadMesh, b: QuadMesh, distance: float = 0.0) -> bool:
    """Whether two closed meshes come within `distance` of each other: their surfaces do, or one lies in the other."""
    low = np.maximum(a.bounds[0], b.bounds[0]) - distance
    high = np.minimum(a.bounds[1], b.bounds[1]) + distance
    if np.any(low > high):
        return False
    mine, other = _between(a, low, high), _between(b, low, high)
    if len(mine) and len(other) and _surfaces_meet(a.vertices, mine, b.vertices, other, distance):
        return True
    return _inside(a.vertices[0], b) or _inside(b.vertices[0], a)


def _surfaces_meet(
    vertices: FloatArray, faces: np.ndarray, others: FloatArray, other_faces: np.ndarray, distance: float
) -> bool:
    from stages.shape.geometry.mesh_pairs import build_tree, first_contact

    return first_contact(build_tree(vertices, faces), build_tree(others, other_faces), np.eye(4), distance)


def _between(mesh: QuadMesh, low: FloatArray, high: FloatArray) -> np.ndarray:
    """The triangles whose boxes reach into the box from `low` to `high`, int32 (k, 3)."""
    corners = mesh.vertices[mesh.triangles]
    reaching = (corners.min(axis=1) <= high) & (corners.max(axis=1) >= low)
    faces: np.ndarray = mesh.triangles[reaching.all(axis=1)]
    return faces


def _inside(point: FloatArray, mesh: QuadMesh) -> bool:
    """Whether a point lies inside a closed surface: its solid angle is seen from there (van Oosterom and Strackee)."""
    if np.any(point < mesh.bounds[0]) or np.any(point > mesh.bounds[1]):
        return False
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] - point for k in range(3))
    x, y, z = (np.linalg.norm(each, axis=1) for each in (a, b, c))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c))
    spread = x * y * z + (a * b).sum(axis=1) * z + (b * c).sum(axis=1) * x + (c * a).sum(axis=1) * y
    winding = np.arctan2(volume, spread).sum() / (2 * np.pi)
    return bool(abs(winding) > 0.5)
