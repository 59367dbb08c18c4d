"""Area and normal of triangles given by their corners."""

from __future__ import annotations

import numpy as np

from stages.shape.arrays import FloatArray


def area_vectors(corners: FloatArray) -> FloatArray:
    """Return the vector along the normal of each triangle (..., 3, 3) whose length is twice the area, (..., 3)."""
    origin = corners[..., 0, :]
    vectors: FloatArray = np.cross(corners[..., 1, :] - origin, corners[..., 2, :] - origin)
    return vectors


def triangle_areas(corners: FloatArray) -> FloatArray:
    """Return the area of each triangle (..., 3, 3), float64 (...)."""
    areas: FloatArray = np.linalg.norm(area_vectors(corners), axis=-1) / 2
    return areas


def unit_normals(corners: FloatArray) -> FloatArray:
    """Return the unit normal of each triangle (..., 3, 3) by its winding, (..., 3); zero for one without area."""
    vectors = area_vectors(corners)
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    normals: FloatArray = np.divide(vectors, lengths, out=np.zeros_like(vectors), where=lengths > 0)
    return normals
