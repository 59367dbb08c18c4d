"""The smallest box around points, in any orientation."""

from __future__ import annotations

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shapeassembly.extraction.hierarchy import Box

__all__ = ["minimum_box"]


def minimum_box(points: FloatArray) -> Box:
    """The box of least volume around `points`, float64 (n, 3), one of whose sides lies on the convex hull.

    Box axes that fit as well as the coordinate axes (within 1 %) are the coordinate axes: round and square parts
    have many smallest boxes. Points in a plane or on a line get a box of no thickness, turned within the plane.
    """
    from scipy.spatial import ConvexHull, QhullError

    upright = _box(points, np.eye(3))
    try:
        hull = ConvexHull(points)
    except (QhullError, ValueError):
        return _flat(points, upright)
    corners = points[hull.vertices]
    normals = hull.equations[:, :3]
    edges = points[hull.simplices[:, [1, 2, 0]]] - points[hull.simplices]
    frames = _frames(np.repeat(normals, 3, axis=0), edges.reshape(-1, 3))
    best, volume = upright, float(np.prod(upright.size)) * 0.99
    spans = _spans(corners, frames)
    chosen = int(np.prod(spans, axis=1).argmin())
    if np.prod(spans[chosen]) < volume:
        best = _box(points, frames[chosen])
    return best


def _flat(points: FloatArray, upright: Box) -> Box:
    """The box of points whose hull has no volume: the least sum of lengths over turns of their principal frame."""
    centred = points - points.mean(axis=0)
    normal = np.linalg.svd(centred, full_matrices=True)[2][2] if len(points) > 1 else np.array([0.0, 0.0, 1.0])
    edges = np.diff(np.vstack([points, points[:1]]), axis=0)[:256]
    frames = _frames(np.repeat(normal[None], len(edges), axis=0), edges)
    if not len(frames):
        return upright
    sums = _spans(points, frames).sum(axis=1)
    chosen = int(sums.argmin())
    return _box(points, frames[chosen]) if sums[chosen] < upright.size.sum() * 0.99 else upright


def _frames(normals: FloatArray, edges: FloatArray) -> FloatArray:
    """Right-handed frames (k, 3, 3) with a row along each normal and one along its edge; no-edge rows are left out."""
    edges = edges - normals * (edges * normals).sum(axis=1, keepdims=True)
    lengths = np.linalg.norm(edges, axis=1)
    kept = lengths > 1e-12
    edges, normals = edges[kept] / lengths[kept, None], normals[kept]
    return np.stack([edges, normals, np.cross(edges, normals)], axis=1)


def _spans(points: FloatArray, frames: FloatArray) -> FloatArray:
    """Lengths of the boxes around the points in each frame, (k, 3); in blocks, so that memory stays small."""
    blocks = [
        np.ptp(points @ frames[start : start + 512].transpose(0, 2, 1), axis=1) for start in range(0, len(frames), 512)
    ]
    return np.concatenate(blocks)


def _box(points: FloatArray, axes: FloatArray) -> Box:
    local = points @ axes.T
    low, high = local.min(axis=0), local.max(axis=0)
    return Box((low + high) / 2 @ axes, high - low, axes)
