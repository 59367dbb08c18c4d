"""Structure of a shape: its stand and its symmetry."""

from __future__ import annotations

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.geometry.polygons import convex_hull
from stages.shape.physics.contacts import ContactPatches
from stages.shape.physics.solids import PlacedParts

MIRROR_TOLERANCE_SHARE = 0.02
"""Mirror images differ in centroids and extents by at most this share of the shape's diagonal."""


def ground_share(placed: PlacedParts, standing: ContactPatches) -> float:
    """Return the area on which the shape stands, as a share of the area of its outline seen from above.

    The area is that of each part's hull of ground points. It is 0 if the shape stands on points or lines.
    """
    outline = np.concatenate(placed.points)[:, :2]
    whole = _area(outline[convex_hull(outline)])
    if whole <= 1e-12 * placed.diagonal**2:
        return 0.0
    parts = np.unique(standing.first).tolist()
    return min(1.0, sum(_area(standing.points[standing.first == part, :2]) for part in parts) / whole)


def _area(polygon: FloatArray) -> float:
    following = np.roll(polygon, -1, axis=0)
    return float(abs((polygon[:, 0] * following[:, 1] - polygon[:, 1] * following[:, 0]).sum()) / 2)


def mirror_score(placed: PlacedParts) -> float:
    """Return the greatest share of the weight that an upright mirror through the centre of mass maps to equal parts.

    Equal parts have the same position of the centroid and the same extents, within MIRROR_TOLERANCE_SHARE. Any mirror
    of the shape maps the outmost part, by weight, to one of its kind. So the planes tried are those between that part
    and each other, and through that part.
    """
    centre = placed.weights @ placed.centroids
    positions = placed.centroids - centre
    spreads = _spreads(placed)
    outmost = int(np.argmax(placed.weights * (positions[:, :2] ** 2).sum(axis=1)))
    ways = positions[outmost, :2] - positions[:, :2]
    alike = np.abs(positions[:, 2] - positions[outmost, 2]) <= MIRROR_TOLERANCE_SHARE * placed.diagonal
    ways = ways[alike & (np.linalg.norm(ways, axis=1) > 1e-9 * placed.diagonal)]
    own = positions[outmost, :2]
    if np.linalg.norm(own) <= MIRROR_TOLERANCE_SHARE * placed.diagonal:
        own = _long_axis(placed)
    normals = np.concatenate([ways, [[-own[1], own[0]]], [own]])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return float(_matched(placed, positions, spreads, normals).max())


def _long_axis(placed: PlacedParts) -> FloatArray:
    """Return the level axis along which the points of the shape spread most."""
    flat = np.concatenate(placed.points)[:, :2] - (placed.weights @ placed.centroids)[:2]
    axis: FloatArray = np.linalg.eigh(flat.T @ flat)[1][:, 1]
    return axis


def _spreads(placed: PlacedParts) -> FloatArray:
    """Return how the corners of each part spread about their middle, float64 (n, 3, 3), as a root of second moments."""
    moments = np.empty((len(placed), 3, 3))
    for part, points in enumerate(placed.points):
        centred = points - points.mean(axis=0)
        moments[part] = centred.T @ centred / len(points)
    values, vectors = np.linalg.eigh(moments)
    spreads: FloatArray = (vectors * np.sqrt(np.maximum(values, 0.0))[:, None]) @ np.swapaxes(vectors, 1, 2)
    return spreads


def _matched(placed: PlacedParts, positions: FloatArray, spreads: FloatArray, normals: FloatArray) -> FloatArray:
    """Return the weight that each mirror maps to equal parts, float64 (k,).

    normals: of the mirrors, level and of length 1, float64 (k, 2)
    """
    from scipy.spatial import cKDTree

    mirrors = np.tile(np.eye(3), (len(normals), 1, 1))
    mirrors[:, :2, :2] -= 2 * normals[:, :, None] * normals[:, None, :]
    there = np.concatenate([positions, spreads.reshape(-1, 9)], axis=1)
    turned = mirrors[:, None] @ spreads @ mirrors[:, None]
    mirrored = np.concatenate([positions @ mirrors, turned.reshape(len(normals), -1, 9)], axis=2)
    distances, _ = cKDTree(there).query(mirrored, distance_upper_bound=MIRROR_TOLERANCE_SHARE * placed.diagonal)
    matched: FloatArray = np.isfinite(distances) @ placed.weights
    return matched
