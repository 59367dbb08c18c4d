"""Check that the points of a sample are points of its shape, with Open3D, which did not make them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from stages.points.members import cloud_number
from stages.points.scan_checks import scan_faults
from stages.points.triangle_distances import point_triangle_distances
from stages.points.visibility import MIN_HIT_DISTANCE_SHARE, view_directions
from stages.shape.arrays import FloatArray, IntArray
from stages.shape.collection.audit import Audit
from stages.shape.collection.packaged import PackagedSample
from stages.shape.geometry.triangles import unit_normals

MAX_SURFACE_GAP_SHARE = 1e-5
"""Largest distance of the 32-bit points from the surface, as a share of the shape's size."""
MAX_COSINE_ERROR = 1e-3
"""Largest deviation from 1 of the cosine between a normal and that of its triangle."""


def cloud_faults(sample: PackagedSample) -> Iterator[str]:
    """Yield a sentence for points of clouds and scans that are not on their part, and for normals not its own."""
    if "points" not in sample.record:
        return
    for index in range(sample.record["points"].get("clouds", 1)):
        where = f"cloud {index}: " if index else ""
        for fault in _point_faults(sample, cloud_number(index)):
            yield where + fault
    for index in range(len(sample.record.get("scans", []))):
        for fault in scan_faults(sample, index):
            yield f"scan {index}: {fault}"


def _point_faults(sample: PackagedSample, number: str) -> Iterator[str]:
    """Yield the faults of one cloud. number: what its members' names end with"""
    described = sample.record["points"]
    points = sample.arrays[f"points{number}.npy"].astype(np.float64) / described["scale"] + described["centre"]
    normals = sample.arrays[f"normals{number}.npy"].astype(np.float64)
    instances = sample.arrays[f"instances{number}.npy"].astype(np.int32)
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
    if (sample.shape.part_classes[instances] != sample.arrays[f"labels{number}.npy"]).any():
        yield "its point labels are not the classes of their parts"
    counts = np.bincount(instances[described["farthest"] :], minlength=len(sample.shape))
    if described["surface"] == "all" and counts.min() < described.get("min_per_part", 0):
        yield f"a part has {counts.min()} points, fewer than the {described['min_per_part']} of its json"
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
        gaps = point_triangle_distances(points[mine], triangles)
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


AUDIT = Audit(faults=cloud_faults)
