"""Distances of points from triangles, written without a library, to check what libraries find."""

from __future__ import annotations

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.geometry.triangles import area_vectors


def point_triangle_distances(points: FloatArray, corners: FloatArray) -> FloatArray:
    """Return the distance of each point (n, 3) from each triangle (t, 3, 3), float64 (n, t), by barycentric regions."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    inside = _plane_distances(points, corners)
    edges = np.minimum.reduce([_segment_distances(points, *ends) for ends in ((a, b), (b, c), (c, a))])
    return np.minimum(inside, edges)


def _plane_distances(points: FloatArray, corners: FloatArray) -> FloatArray:
    """Return the distance from the plane of a triangle if the foot of the point lies inside, else infinity."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    normals = area_vectors(corners)
    area = np.einsum("ij,ij->i", normals, normals)
    safe = np.where(area > 0, area, 1.0)
    away = points[:, None] - a[None]
    first = np.einsum("ntj,tj->nt", np.cross((b - a)[None], away), normals) / safe
    second = np.einsum("ntj,tj->nt", np.cross(away, (c - a)[None]), normals) / safe
    height = np.abs(np.einsum("ntj,tj->nt", away, normals)) / np.sqrt(safe)
    return np.where((first >= 0) & (second >= 0) & (first + second <= 1) & (area > 0), height, np.inf)


def _segment_distances(points: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    along = end - start
    length = np.einsum("ij,ij->i", along, along)
    away = points[:, None] - start[None]
    share = np.einsum("ntj,tj->nt", away, along) / np.where(length > 0, length, 1.0)
    distances: FloatArray = np.linalg.norm(away - np.clip(share, 0, 1)[:, :, None] * along[None], axis=2)
    return distances
