"""Which points of a surface a scanner sees: those from which a way leads straight out of the shape."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from stages.shape.arrays import BoolArray, FloatArray
from stages.shape.geometry.ray_casting import RayCaster

VIEW_COUNT = 64
"""From so many directions, evenly around, a shape is looked at."""

MIN_VIEW_COSINE = 0.1
"""A surface is not seen at a smaller cosine between its normal and the view: within six degrees of edge-on."""

MIN_HIT_DISTANCE_SHARE = 1e-4
"""As a share of the shape's size: what is in the way nearer than this is the surface itself."""


def seen_from_outside(casting: RayCaster, points: FloatArray, normals: FloatArray) -> BoolArray:
    """Which points float64 (n, 3) on the shape, with unit normals (n, 3), are seen from one of VIEWS directions, from
    far away and with nothing in between. Either side of a surface is seen, so that open sheets and meshes that are
    inside out have points, too."""
    seen = np.zeros(len(points), dtype=np.bool_)
    left = np.arange(len(points))
    for view in view_directions():
        facing = left[np.abs(normals[left] @ view) > MIN_VIEW_COSINE]
        ways = np.broadcast_to(view, (len(facing), 3))
        seen[facing] = ~casting.hit(points[facing], ways, MIN_HIT_DISTANCE_SHARE * casting.size)
        left = left[~seen[left]]
        if not len(left):
            break
    return seen


@lru_cache(maxsize=1)
def view_directions() -> FloatArray:
    """Unit directions, float64 (VIEWS, 3), evenly around at any number of the first of them: heights by the radical
    inverse of the number in base 2, turned by the golden angle."""
    number = np.arange(VIEW_COUNT)
    bits = np.arange(16)
    height = 1.0 - 2.0 * (((number[:, None] >> bits) & 1) * 0.5 ** (bits + 1.0)).sum(axis=1) - 1.0 / VIEW_COUNT
    turn = np.pi * (3.0 - np.sqrt(5.0)) * number
    flat = np.sqrt(1.0 - height * height)
    directions = np.stack([flat * np.cos(turn), height, flat * np.sin(turn)], axis=1)
    directions.flags.writeable = False
    return directions
