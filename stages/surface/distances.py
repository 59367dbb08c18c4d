"""Signed distances and occupancy of the union of a shape's parts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stages.shape.arrays import ByteArray, Float32Array, FloatArray
from stages.shape.geometry.mesh_pairs import build_tree, distances_to_surface
from stages.shape.geometry.triangles import triangle_areas
from stages.surface.settings import DistanceConfig
from stages.surface.union import SolidSurface, UnionMesh
from stages.surface.winding import inside_any


@dataclass(frozen=True)
class Cube:
    """The cube around a shape.

    low: lowest corner, float64 (3,)
    side: length of its sides
    """

    low: FloatArray
    side: float


def cube_around(union: UnionMesh, padding: float) -> Cube:
    """Return the cube around a union, with a margin of `padding` of the longest side on each side."""
    low, high = union.vertices.min(axis=0), union.vertices.max(axis=0)
    longest = float((high - low).max())
    side = longest * (1 + 2 * padding)
    return Cube((low + high - side) / 2, side)


def distance_points(union: UnionMesh, cube: Cube, config: DistanceConfig, rng: np.random.Generator) -> Float32Array:
    """Draw points near the surface, then points anywhere in the cube, float32 (near + uniform, 3)."""
    corners = union.vertices[union.faces]
    areas = triangle_areas(corners)
    chosen = np.minimum(np.searchsorted(np.cumsum(areas), rng.random(config.near) * areas.sum()), len(areas) - 1)
    u, v = rng.random(config.near), rng.random(config.near)
    turned = u + v > 1
    u, v = np.where(turned, 1 - u, u)[:, None], np.where(turned, 1 - v, v)[:, None]
    a, b, c = (corners[chosen, corner] for corner in range(3))
    longest = float(np.ptp(union.vertices, axis=0).max())
    near = a + u * (b - a) + v * (c - a) + config.spread * longest * rng.standard_normal((config.near, 3))
    uniform = cube.low + cube.side * rng.random((config.uniform, 3))
    return np.concatenate([near, uniform]).astype(np.float32)


def signed_distances(solids: Sequence[SolidSurface], union: UnionMesh, points: Float32Array) -> Float32Array:
    """Return the distance of points to the surface of the union, negative inside, float32 (n,).

    The sign is that of the winding numbers of the parts, and the distance that to the union.
    """
    exact = points.astype(np.float64)
    lengths = distances_to_surface(*build_tree(union.vertices, union.faces), exact)
    distances: Float32Array = np.where(inside_any(solids, exact), -lengths, lengths).astype(np.float32)
    return distances


def occupancy_grid(solids: Sequence[SolidSurface], cube: Cube, cells: int) -> ByteArray:
    """Return which middles of cells are inside, as bits along the last axis, uint8 (cells, cells, cells / 8).

    `numpy.unpackbits(grid, axis=2)` gives (x, y, z).
    """
    middles = (np.arange(cells) + 0.5) / cells * cube.side
    places = np.stack(np.meshgrid(middles, middles, middles, indexing="ij"), axis=-1).reshape(-1, 3) + cube.low
    return np.packbits(inside_any(solids, places).reshape(cells, cells, cells), axis=2)
