"""Points on the surface of a shape, and the Chamfer distance of clouds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stages.points.area_sampling import sample_surface
from stages.programs.curves.part import Part, joined
from stages.shape.arrays import FloatArray, IntArray
from stages.shape.geometry.triangles import triangle_areas

PLASTIC_NUMBER = 1.32471795724474602596
"""Multiples of its inverse powers fill a square evenly (Roberts 2018)."""


def even_points(vertices: FloatArray, faces: IntArray, n: int) -> FloatArray:
    """Place `n` points on a mesh by area, float64 (n, 3), without randomness.

    Where the surface changes a little, the points move a little.

    vertices: float64 (v, 3)
    faces: int32 (f, 3)
    """
    corners = vertices[faces]
    first, along, across = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    cumulative = np.cumsum(triangle_areas(corners))
    steps = np.arange(n) + 0.5
    hit = np.minimum(np.searchsorted(cumulative, steps / n * cumulative[-1]), len(faces) - 1)
    a, b = (steps / PLASTIC_NUMBER) % 1.0, (steps / PLASTIC_NUMBER**2) % 1.0
    a, b = np.where(a + b > 1.0, 1.0 - a, a), np.where(a + b > 1.0, 1.0 - b, b)
    points: FloatArray = first[hit] + a[:, None] * along[hit] + b[:, None] * across[hit]
    return points


def shape_points(parts: Sequence[Part], n: int) -> FloatArray:
    """`even_points` of all parts of a shape together."""
    mesh = joined(parts).mesh
    return even_points(mesh.vertices, mesh.triangles, n)


def sample_points(parts: Sequence[Part], n: int, rng: np.random.Generator) -> FloatArray:
    """Draw `n` random points from all parts of a shape together, float64 (n, 3)."""
    mesh = joined(parts).mesh
    return sample_surface(mesh.vertices, mesh.triangles, n, rng)[0]
