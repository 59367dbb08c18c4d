"""Winding numbers of points about solids: how often a closed surface goes around a point."""

from __future__ import annotations

from collections.abc import Sequence

import numba
import numpy as np

from stages.shape.arrays import BoolArray, FloatArray
from stages.surface.union import SolidSurface


def inside_any(solids: Sequence[SolidSurface], points: FloatArray) -> BoolArray:
    """Return which points, float64 (n, 3), lie in the union of solids, bool (n,).

    The winding number of a closed surface is a whole number, 0 outside: nothing is asked of points outside the box of
    a solid, or already found inside another.
    """
    inside: BoolArray = np.zeros(len(points), dtype=bool)
    for solid in solids:
        low, high = solid.vertices.min(axis=0), solid.vertices.max(axis=0)
        asked = np.flatnonzero(~inside & ((points >= low) & (points <= high)).all(axis=1))
        if len(asked):
            inside[asked] = winding_numbers(solid.vertices[solid.faces], points[asked]) > 0.5
    return inside


@numba.njit(cache=True)
def winding_numbers(corners, points):
    """Return the winding number of a closed surface about each point, float64 (n,).

    It is the sum of the signed solid angles of the triangles (van Oosterom and Strackee 1983), over 4 pi.

    corners: float64 (f, 3, 3)
    points: float64 (n, 3)
    """
    numbers = np.zeros(len(points))
    for index in range(len(points)):
        x, y, z = points[index]
        total = 0.0
        for face in range(len(corners)):
            ax, ay, az = corners[face, 0, 0] - x, corners[face, 0, 1] - y, corners[face, 0, 2] - z
            bx, by, bz = corners[face, 1, 0] - x, corners[face, 1, 1] - y, corners[face, 1, 2] - z
            cx, cy, cz = corners[face, 2, 0] - x, corners[face, 2, 1] - y, corners[face, 2, 2] - z
            a = np.sqrt(ax * ax + ay * ay + az * az)
            b = np.sqrt(bx * bx + by * by + bz * bz)
            c = np.sqrt(cx * cx + cy * cy + cz * cz)
            det = ax * (by * cz - bz * cy) - ay * (bx * cz - bz * cx) + az * (bx * cy - by * cx)
            dots = (ax * bx + ay * by + az * bz) * c + (bx * cx + by * cy + bz * cz) * a
            dots += (cx * ax + cy * ay + cz * az) * b
            total += np.arctan2(det, a * b * c + dots)
        numbers[index] = total / (2.0 * np.pi)
    return numbers
