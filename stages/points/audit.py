"""Check that the points of a sample are points of its shape, with Open3D, which did not make them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from stages.points.visibility import MIN_HIT_DISTANCE_SHARE, view_directions
from stages.shape.arrays import FloatArray, IntArray
from stages.shape.collection.audit import Audit
from stages.shape.collection.packaged import PackagedSample
from stages.shape.geometry.triangles import area_vectors, unit_normals

MAX_SURFACE_GAP_SHARE = 1e-5
"""Largest distance of the 32-bit points from the surface, as a share of the shape's size."""
MAX_COSINE_ERROR = 1e-3
"""Largest deviation from 1 of the cosine between a normal and that of its triangle."""


def point_faults(sample: PackagedSample) -> Iterator[str]:
    """Yield a sentence for points that are not on their part, and for normals that are not its own."""
    if "points" not in sample.record:
        return
    described = sample.record["points"]
    points = sample.arrays["points.npy"].astype(np.float64) / described["scale"] + described["centre"]
    normals = sample.arrays["normals.npy"].astype(np.float64)
    instances = sample.arrays["instances.npy"].astype(np.int32)
    if not np.isfinite(points).all() or not np.isfinite(normals).all():
        return  # other checks report arrays that are not finite
    if len(points) != described["farthest"] + described["uniform"]:
        yield "the lengths of its point arrays differ from the counts in its json"
        return
    if np.abs(np.linalg.norm(normals, axis=1) - 1.0).max() > MAX_SURFACE_GAP_SHARE:
        yield "its normals are not of unit length"
    if instances.min() < 0 or instances.max() >= len(sample.shape):
        yield "its points name parts that do not exist"
        return
    if (sample.shape.part_classes[instances] != sample.arrays["labels.npy"]).any():
        yield "its point labels are not the classes of their parts"
    near = MAX_SURFACE_GAP_SHARE * max(sample.size, float(np.abs(sample.record["bounds"]).max()))
    off, turned = _misplaced(sample, points, normals, instances, near)
    if off:
        yield f"{off} of its {len(points):,} points are not on the surface of their part"
    if turned:
        yield f"{turned} of its {len(points):,} normals are not those of their part"
    unseen = _unseen(sample, points) if described["surface"] == "visible" else 0
    if unseen:
        yield f"{unseen} of its {len(points):,} points cannot be seen from outside"


def _misplaced(
    sample: PackagedSample, points: FloatArray, normals: FloatArray, instances: IntArray, near: float
) -> tuple[int, int]:
    """Return how many points are off the surface of their part, and how many others have a normal of no triangle there.

    The nearest triangle of all decides for nearly all points. The others, where parts meet or at edges, are compared
    with each triangle of their part.
    """
    corners, parts = sample.rays.triangles
    nearest, distances = sample.rays.nearest(points)
    own = parts[nearest] == instances
    along = np.einsum("ij,ij->i", normals, unit_normals(corners[nearest])) > 1.0 - MAX_COSINE_ERROR
    doubtful = np.flatnonzero(~(own & along & (distances <= near)))
    off = turned = 0
    for part in np.unique(instances[doubtful]).tolist():
        mine = doubtful[instances[doubtful] == part]
        triangles = corners[parts == part]
        gaps = _distances(points[mine], triangles)
        touching = gaps <= near
        off += int((~touching.any(axis=1)).sum())
        fitting = normals[mine] @ unit_normals(triangles).T > 1.0 - MAX_COSINE_ERROR
        turned += int((touching.any(axis=1) & ~(touching & fitting).any(axis=1)).sum())
    return off, turned


def _unseen(sample: PackagedSample, points: FloatArray) -> int:
    """Return how many points are invisible from outside, looking inwards; they were found by looking outwards."""
    away = 2.0 * sample.size
    for view in view_directions():
        ways = np.broadcast_to(-view, points.shape)
        points = points[
            sample.rays.hit(points + away * view, ways, farthest=away - 2.0 * MIN_HIT_DISTANCE_SHARE * sample.size)
        ]
        if not len(points):
            break
    return len(points)


def _distances(points: FloatArray, corners: FloatArray) -> FloatArray:
    """Return the distance of each of n points from each of t triangles, float64 (n, t), by barycentric regions."""
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


AUDIT = Audit(faults=point_faults)
