"""Exact geometric predicates on float coordinates: signs without rounding, by whole numbers."""

from __future__ import annotations

from collections.abc import Sequence
from math import frexp

import numpy as np

Point = tuple[int, int, int]
_MANTISSA_BITS = 53


def exact_points(points: np.ndarray) -> list[Point]:
    """Return finite points (n, 3) as whole numbers, scaled by a common power of two that loses nothing."""
    flat = [frexp(value) for value in points.reshape(-1).tolist()]
    lowest = min((exponent for mantissa, exponent in flat if mantissa), default=0)
    whole = [
        int(mantissa * (1 << _MANTISSA_BITS)) << (exponent - lowest) if mantissa else 0 for mantissa, exponent in flat
    ]
    return [(whole[index], whole[index + 1], whole[index + 2]) for index in range(0, len(whole), 3)]


def orientation(a: Point, b: Point, c: Point, d: Point) -> int:
    """Return the side of the plane through a, b, c that d is on: 1, -1, or 0 in the plane."""
    ax, ay, az = a[0] - d[0], a[1] - d[1], a[2] - d[2]
    bx, by, bz = b[0] - d[0], b[1] - d[1], b[2] - d[2]
    cx, cy, cz = c[0] - d[0], c[1] - d[1], c[2] - d[2]
    value = ax * (by * cz - bz * cy) - ay * (bx * cz - bz * cx) + az * (bx * cy - by * cx)
    return (value > 0) - (value < 0)


def normal(a: Point, b: Point, c: Point) -> Point:
    """Return the vector across a triangle; zero for one without area."""
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    return uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx


def segment_meets_triangle(p: Point, q: Point, triangle: Sequence[Point]) -> bool:
    """Return whether a segment and a triangle with area have a point in common."""
    a, b, c = triangle
    side_p, side_q = orientation(a, b, c, p), orientation(a, b, c, q)
    if side_p * side_q > 0:
        return False
    if side_p == 0 and side_q == 0:
        return _meets_in_plane(p, q, a, b, c)
    sides = {orientation(p, q, a, b), orientation(p, q, b, c), orientation(p, q, c, a)}
    return not {1, -1} <= sides


def same_side(u: Point, v: Point, a: Point, b: Point) -> bool:
    """Return whether two triangles u, v, a and u, v, b in one plane overlap in more than their edge u, v."""
    first, second = normal(u, v, a), normal(u, v, b)
    return sum(x * y for x, y in zip(first, second, strict=True)) > 0


def _meets_in_plane(p: Point, q: Point, a: Point, b: Point, c: Point) -> bool:
    across = normal(a, b, c)
    axis = max(range(3), key=lambda index: abs(across[index]))
    keep = [index for index in range(3) if index != axis]
    flat = [(point[keep[0]], point[keep[1]]) for point in (p, q, a, b, c)]
    start, end, corners = flat[0], flat[1], flat[2:]
    if _inside(start, corners):
        return True
    sides = ((corners[0], corners[1]), (corners[1], corners[2]), (corners[2], corners[0]))
    return any(_cross(start, end, low, high) for low, high in sides)


Flat = tuple[int, int]


def _turn(a: Flat, b: Flat, c: Flat) -> int:
    value = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    return (value > 0) - (value < 0)


def _inside(point: Flat, corners: Sequence[Flat]) -> bool:
    a, b, c = corners
    return not {1, -1} <= {_turn(a, b, point), _turn(b, c, point), _turn(c, a, point)}


def _cross(p: Flat, q: Flat, a: Flat, b: Flat) -> bool:
    """Return whether two segments of a plane have a point in common."""
    if _turn(p, q, a) * _turn(p, q, b) > 0 or _turn(a, b, p) * _turn(a, b, q) > 0:
        return False
    return all(max(min(p[k], q[k]), min(a[k], b[k])) <= min(max(p[k], q[k]), max(a[k], b[k])) for k in range(2))
