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
        a, b, c = vertices[faces[f, 0]], vertices[faces[f, 1]], vertices[faces[f, 2]]
        area = np.linalg.norm(np.cross(b - a, c - a))
        for k in range(3):
            here, ahead, behind = (
                vertices[faces[f, k]],
                vertices[faces[f, (k + 1) % 3]],
                vertices[faces[f, (k + 2) % 3]],
            )
            weights[f, k] = area * np.arctan2(area, np.dot(ahead - here, behind - here))
            first[welded[f, k] + 1] += 1
    first = np.cumsum(first)
    corners, filled = np.empty(3 * count, np.int64), first.copy()
    for f in range(count):
        for k in range(3):
            corners[filled[welded[f, k]]] = 3 * f + k
            filled[welded[f, k]] += 1
    corner_normals = np.zeros((count, 3, 3), np.float32)
    for f in range(count):
        own = normals[f]
        for k in range(3):
            total = np.zeros(3)
            for index in range(first[welded[f, k]], first[welded[f, k] + 1]):
                other, corner = corners[index] // 3, corners[index] % 3
                if np.dot(own, normals[other]) >= min_cosine:
                    total += weights[other, corner] * normals[other]
            length = np.linalg.norm(total)
            corner_normals[f, k] = total / length if length > 0.0 else own
    return corner_normals
