"""Corner normals of a mesh for smooth shading.

Numba compiles this module when it is imported: import it inside functions.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from stages.shape.arrays import Float32Array, FloatArray, IntArray

CREASE_ANGLE_DEGREES = 35.0
"""Faces around a vertex whose normals differ by more are shaded separately."""


def corner_normals(vertices: FloatArray, faces: IntArray, welded: np.ndarray, normals: FloatArray) -> Float32Array:
    """Return the unit normal at each corner of each face, float32 (f, 3, 3).

    A corner normal is the mean normal of the faces around the vertex that differ from this face by less than
    CREASE_ANGLE_DEGREES. Faces are weighted by their area and their angle there, so that a small bevel does not bend
    the normals of a large face.

    vertices: float64 (v, 3).
    faces: int32 (f, 3).
    welded: int64 (f, 3), one number for all corners at the same position.
    normals: unit normals of the faces, float64 (f, 3), zero for faces without area.
    """
    min_cosine = math.cos(math.radians(CREASE_ANGLE_DEGREES))
    corners: Float32Array = _corner_normals(vertices, faces, welded, normals, min_cosine)
    return corners


@numba.njit(cache=True, error_model="numpy")
def _corner_normals(vertices, faces, welded, normals, min_cosine):
    count = len(faces)
    weights = np.zeros((count, 3))
    first = np.zeros(welded.max() + 2 if count else 1, np.int64)
    for f in range(count):
        for k in range(3):
            here, ahead, behind = faces[f, k], faces[f, (k + 1) % 3], faces[f, (k + 2) % 3]
            ux, uy, uz = _way(vertices, here, ahead)
            vx, vy, vz = _way(vertices, here, behind)
            x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
            area = np.sqrt(x * x + y * y + z * z)
            weights[f, k] = area * np.arctan2(area, ux * vx + uy * vy + uz * vz)
            first[welded[f, k] + 1] += 1
    for index in range(1, len(first)):
        first[index] += first[index - 1]
    corners, filled = np.empty(3 * count, np.int64), first.copy()
    for f in range(count):
        for k in range(3):
            corners[filled[welded[f, k]]] = 3 * f + k
            filled[welded[f, k]] += 1
    corner_normals = np.zeros((count, 3, 3), np.float32)
    for f in range(count):
        for k in range(3):
            x, y, z = 0.0, 0.0, 0.0
            for index in range(first[welded[f, k]], first[welded[f, k] + 1]):
                other, corner = corners[index] // 3, corners[index] % 3
                if _cosine(normals, f, other) >= min_cosine:
                    x += weights[other, corner] * normals[other, 0]
                    y += weights[other, corner] * normals[other, 1]
                    z += weights[other, corner] * normals[other, 2]
            length = np.sqrt(x * x + y * y + z * z)
            if length > 0.0:
                corner_normals[f, k, 0], corner_normals[f, k, 1] = x / length, y / length
                corner_normals[f, k, 2] = z / length
            else:
                for axis in range(3):
                    corner_normals[f, k, axis] = normals[f, axis]
    return corner_normals


@numba.njit(cache=True, error_model="numpy")
def _way(vertices, start, end):
    """Return the vector from one vertex to another, as three numbers."""
    return (
        vertices[end, 0] - vertices[start, 0],
        vertices[end, 1] - vertices[start, 1],
        vertices[end, 2] - vertices[start, 2],
    )


@numba.njit(cache=True, error_model="numpy")
def _cosine(normals, a, b):
    """Return the cosine of the angle between two unit normals."""
    return normals[a, 0] * normals[b, 0] + normals[a, 1] * normals[b, 1] + normals[a, 2] * normals[b, 2]
