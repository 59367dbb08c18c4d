"""The smallest box around points, in any orientation."""

from __future__ import annotations

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.geometry.triangles import triangle_areas
from stages.shapeassembly.extraction.boxes import bounding_box
from stages.shapeassembly.extraction.hierarchy import Box

MAX_HULL_SIDES = 100
"""Sides of the convex hull that are tried, the largest first: a rounded part has thousands."""

MAX_TURNED_SHARE = 0.99
"""Maximum volume of a turned box, as a share of the upright one: round and square parts have many smallest boxes."""


def minimum_box(points: FloatArray, max_turned_share: float = MAX_TURNED_SHARE) -> Box:
    """Return the smallest box around points, float64 (n, 3), among those with a side on a large side of their hull.

    It is upright unless a turned one has less than `max_turned_share` of its volume. Points in a plane get a flat box
    of minimum area, turned with the plane.
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
    return best if np.prod(best.size) < max_turned_share * np.prod(upright.size) else upright


def _largest_sides(normals: FloatArray, triangles: FloatArray) -> FloatArray:
    """Return directions (k, 3) of the hull's largest sides; opposite and coplanar triangles (t, 3, 3) are one side."""
    flipped = np.where(normals[np.arange(len(normals)), np.abs(normals).argmax(axis=1), None] < 0, -normals, normals)
    kinds, kind = np.unique(np.round(flipped, 3) + 0.0, axis=0, return_inverse=True)
    areas = triangle_areas(triangles)
    total = np.bincount(kind.ravel(), areas, len(kinds))
    first = np.unique(kind.ravel(), return_index=True)[1]
    chosen = np.argsort(-total, kind="stable")[:MAX_HULL_SIDES]
    sides: FloatArray = flipped[first[chosen]]
    return sides


def _flat(points: FloatArray, upright: Box) -> Box:
    """Return the box of points in a plane, on a line, or at one position."""
    normal = np.linalg.svd(points - points.mean(axis=0), full_matrices=True)[2][2]
    turned = _on_side(points, normal)
    return turned if turned.size.sum() < MAX_TURNED_SHARE * upright.size.sum() else upright


def _on_side(points: FloatArray, normal: FloatArray) -> Box:
    """Return the smallest box with a side perpendicular to `normal` (3,) and an edge of the outline on another side."""
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
    perpendicular = np.stack([-edges[:, 1], edges[:, 0]], axis=1)
    areas = np.ptp(outline @ edges.T, axis=0) * np.ptp(outline @ perpendicular.T, axis=0)
    right = edges[int(areas.argmin())] @ plane
    return bounding_box(points, np.stack([right, normal, np.cross(right, normal)]))
