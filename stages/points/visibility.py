"""Which points of a surface a scanner sees: those from which a straight line leads out of the shape."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from stages.shape.arrays import BoolArray, FloatArray
from stages.shape.geometry.ray_casting import RayCaster

VIEW_COUNT = 64
"""Number of directions, evenly around, from which a shape is viewed."""

MIN_VIEW_COSINE = 0.1
"""Smallest cosine between the normal and the view of a visible surface: within six degrees of edge-on."""

MIN_HIT_DISTANCE_SHARE = 1e-4
"""Nearer obstacles, as a share of the shape's size, are the surface itself."""


def seen_from_outside(rays: RayCaster, points: FloatArray, normals: FloatArray) -> BoolArray:
    """Return which points on the shape are seen from one of VIEW_COUNT directions, from far away, bool (n,).

    points: float64 (n, 3)
    normals: unit, float64 (n, 3)

    Either side of a surface is seen, so that open sheets and inside-out meshes have points, too.
    """
    seen = np.zeros(len(points), dtype=np.bool_)
    left = np.arange(len(points))
    for view in view_directions():
        facing = left[np.abs(normals[left] @ view) > MIN_VIEW_COSINE]
        ways = np.broadcast_to(view, (len(facing), 3))
        seen[facing] = ~rays.hit(points[facing], ways, MIN_HIT_DISTANCE_SHARE * rays.size)
        left = left[~seen[left]]
        if not len(left):
            break
    return seen


@lru_cache(maxsize=1)
def view_directions() -> FloatArray:
    """Return unit directions, float64 (VIEW_COUNT, 3), evenly around for any number of the first of them.

    Heights follow the radical inverse of the number in base 2, turned by the golden angle.
    """
    number = np.arange(VIEW_COUNT)
    bits = np.arange(16)
    height = 1.0 - 2.0 * (((number[:, None] >> bits) & 1) * 0.5 ** (bits + 1.0)).sum(axis=1) - 1.0 / VIEW_COUNT
    turn = np.pi * (3.0 - np.sqrt(5.0)) * number
    flat = np.sqrt(1.0 - height * height)
    directions = np.stack([flat * np.cos(turn), height, flat * np.sin(turn)], axis=1)
    directions.flags.writeable = False
    return directions
