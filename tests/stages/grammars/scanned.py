"""A scanner of surfaces with known symmetries: points with noise, outliers and holes."""

from __future__ import annotations

import numpy as np

from stages.points.area_sampling import sample_surface
from tests.stages.symmetry.planted import mesh

OUTLIER_SHARE = 5e-4
"""Share of points that are anywhere in the box."""


def scanned(
    triangles: np.ndarray, count: int, noise: float, holes: int, hole: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Sample about `count` points of triangles (f, 3, 3) with holes.

    noise: standard deviation of the normal noise
    holes, hole: number and radius of balls around points of the surface without points

    Returns the points and the true normals there, float64 (n, 3) each.
    """
    vertices, faces = mesh(triangles)
    places, normals, _ = sample_surface(vertices, faces, count, rng)
    outlier = rng.random(count) < OUTLIER_SHARE
    points = places + rng.normal(size=(count, 3)) * noise
    points[outlier] = places.min(axis=0) + rng.random((int(outlier.sum()), 3)) * np.ptp(places, axis=0)
    kept = np.ones(count, dtype=bool)
    for middle in places[rng.integers(count, size=holes)]:
        kept &= np.linalg.norm(places - middle, axis=1) > hole
    return points[kept], normals[kept]
