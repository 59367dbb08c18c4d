"""The smallest box around points, in any orientation."""

from __future__ import annotations

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.geometry.triangles import triangle_areas
from stages.shapeassembly.extraction.boxes import bounding_box
from stages.shapeassembly.extraction.hierarchy import Box

MAX_HULL_SIDES = 100
"""Sides of the convex hull on which a side of the box may lie, the largest first: a rounded part has thousands."""

MAX_TURNED_SHARE = 0.99
"""How large a turned box may be, as a share of the upright one: a round or square part has many smallest boxes."""


def minimum_box(points: FloatArray, worth_turning: float = MAX_TURNED_SHARE) -> Box:
    """The box of least volume around `points`, float64 (n, 3), among those with a side on a large side of their hull.

    It stands along the coordinate axes unless a turned one has less than `worth_turning` of its volume. Points in a
    plane get a box of no thickness and least area, turned with the plane.
    """
    from scipy.spatial import ConvexHull, QhullError

    upright = bounding_box(points, np.eye(3))
    try:
        hull = ConvexHull(points)
    except (QhullError, ValueError):
        return _flat(points, upright)
    corners = points[hull.vertices]
    normals = _largest_sides(hull.equations[:, :3], points[hull.simplices])
    boxes = [_on_side(corners, normal) for normal in normals]
    best = min(boxes, key=lambda box: float(np.prod(box.size)))
    return best if np.prod(best.size) < worth_turning * np.prod(upright.size) else upright


def _largest_sides(normals: FloatArray, triangles: FloatArray) -> FloatArray:
    """Directions (k, 3) of the hull's largest sides; opposite and coplanar triangles (t, 3, 3) are one side."""
    flipped = np.where(normals[np.arange(len(normals)), np.abs(normals).argmax(axis=1), None] < 0, -normals, normals)
    kinds, kind = np.unique(np.round(flipped, 3) + 0.0, axis=0, return_inverse=True)
    areas = triangle_areas(triangles)
    total = np.bincount(kind.ravel(), areas, len(kinds))
    first = np.unique(kind.ravel(), return_index=True)[1]
    chosen = np.argsort(-total, kind="stable")[:MAX_HULL_SIDES]
    sides: FloatArray = flipped[first[chosen]]
    return sides


def _flat(points: FloatArray, upright: Box) -> Box:
    """The box of points in a plane, on a line, or all in one place."""
    normal = np.linalg.svd(points - points.mean(axis=0), full_matrices=True)[2][2]
    turned = _on_side(points, normal)
    return turned if turned.size.sum() < MAX_TURNED_SHARE * upright.size.sum() else upright


def _on_side(points: FloatArray, normal: FloatArray) -> Box:
    """The smallest box with a side perpendicular to `normal` (3,): one edge of the points' outline lies on a side."""
    from scipy.spatial import ConvexHull, QhullError

    across = np.cross(normal, np.eye(3)[int(np.abs(normal).argmin())])
    across /= np.linalg.norm(across)
    plane = np.stack([across, np.cross(normal, across)])
    flat = points @ plane.T
    try:
        outline = flat[ConvexHull(flat).vertices]
        edges = np.roll(outline, -1, axis=0) - outline
    except (QhullError, ValueError):
        outline, edges = flat, flat[[int(np.linalg.norm(flat - flat[0], axis=1).argmax())]] - flat[0]
    lengths = np.linalg.norm(edges, axis=1)
    edges = edges[lengths > 0] / lengths[lengths > 0, None] if lengths.any() else np.array([[1.0, 0.0]])
    beside = np.stack([-edges[:, 1], edges[:, 0]], axis=1)
    areas = np.ptp(outline @ edges.T, axis=0) * np.ptp(outline @ beside.T, axis=0)
    right = edges[int(areas.argmin())] @ plane
    return bounding_box(points, np.stack([right, normal, np.cross(right, normal)]))
