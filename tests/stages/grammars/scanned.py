"""A scanner of surfaces whose symmetries are known: points with noise, outliers and holes."""

from __future__ import annotations

import numpy as np

from stages.points.area_sampling import sample_surface
from tests.stages.symmetry.planted import mesh

OUTLIERS = 5e-4
"""Share of points that are anywhere in the box."""


def scanned(
    triangles: np.ndarray, count: int, noise: float, holes: int, hole: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """About `count` points (n, 3) of triangles (f, 3, 3) with normal noise of a standard deviation, without those in
    `holes` balls of radius `hole` around points of the surface; and the true normals there (n, 3)."""
    vertices, faces = mesh(triangles)
    places, normals, _ = sample_surface(vertices, faces, count, rng)
    stray = rng.random(count) < OUTLIERS
    points = places + rng.normal(size=(count, 3)) * noise
    points[stray] = places.min(axis=0) + rng.random((int(stray.sum()), 3)) * np.ptp(places, axis=0)
    kept = np.ones(count, dtype=bool)
    for middle in places[rng.integers(count, size=holes)]:
        kept &= np.linalg.norm(places - middle, axis=1) > hole
    return points[kept], normals[kept]
