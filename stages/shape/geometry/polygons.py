"""Flat polygons: cutting, area, convex hull."""

from __future__ import annotations

import numba
import numpy as np

from stages.shape.arrays import FloatArray

THIN_CORNER_SHARE = 1e-7
"""Corners that stand out by less than this share of the hull's length are left out."""


@numba.njit(cache=True)
def cut_polygon(polygon, count, n, sign, offset, out):
    """Write the part of a polygon, its first `count` rows, where sign n . x <= offset, into `out`. Returns its corner
    count.
    """
    kept = 0
    for k in range(count):
        after = (k + 1) % count
        here = sign * (n[0] * polygon[k, 0] + n[1] * polygon[k, 1] + n[2] * polygon[k, 2]) - offset
        there = sign * (n[0] * polygon[after, 0] + n[1] * polygon[after, 1] + n[2] * polygon[after, 2]) - offset
        if here <= 0:
            out[kept] = polygon[k]
            kept += 1
        if (here < 0 and there > 0) or (here > 0 and there < 0):
            t = here / (here - there)
            for i in range(3):
                out[kept, i] = polygon[k, i] + t * (polygon[after, i] - polygon[k, i])
            kept += 1
    return kept


@numba.njit(cache=True)
def polygon_area(polygon, count):
    """Return the area of a flat polygon in space, its first `count` rows."""
    x, y, z = 0.0, 0.0, 0.0
    for k in range(1, count - 1):
        a, b = polygon[k] - polygon[0], polygon[k + 1] - polygon[0]
        x += a[1] * b[2] - a[2] * b[1]
        y += a[2] * b[0] - a[0] * b[2]
        z += a[0] * b[1] - a[1] * b[0]
    return (x * x + y * y + z * z) ** 0.5 / 2


@numba.njit(cache=True)
def _chain(flat, order):
    """Return one side of a convex hull from the first to the last of the ordered points, counter-clockwise.

    Corners that stand out by less than THIN_CORNER_SHARE of its length are left out.
    """
    hull = np.empty(len(order), dtype=np.int64)
    count = 0
    for index in order:
        while count >= 2:
            a, b, c = flat[hull[count - 2]], flat[hull[count - 1]], flat[index]
            if (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) > 0:
                break
            count -= 1
        hull[count] = index
        count += 1
    way = flat[hull[count - 1]] - flat[hull[0]]
    thin = THIN_CORNER_SHARE * (way[0] * way[0] + way[1] * way[1]) ** 0.5
    kept = 1
    for k in range(1, count - 1):
        a, b, c = flat[hull[kept - 1]], flat[hull[k]], flat[hull[k + 1]]
        length = ((c[0] - a[0]) ** 2 + (c[1] - a[1]) ** 2) ** 0.5
        if (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) > thin * length:
            hull[kept] = hull[k]
            kept += 1
    return hull[:kept]


def convex_hull(flat: FloatArray) -> np.ndarray:
    """Return the indices of the corners of the convex hull of points (q, 2), counter-clockwise; two for collinear
    points.
    """
    order = np.lexsort((flat[:, 1], flat[:, 0]))
    if np.ptp(flat, axis=0).max() == 0:
        return order[:1]
    return np.concatenate([_chain(flat, order), _chain(flat, order[::-1].copy())])


def inside_margin(flat: FloatArray, point: FloatArray) -> float:
    """Return how far `point` (2,) lies inside the convex hull of points (q, 2): the distance to its nearest side.

    Outside it is the negative distance to the hull. It is never positive for collinear points.
    """
    hull = flat[convex_hull(flat)]
    ways = np.roll(hull, -1, axis=0) - hull
    lengths = np.maximum((ways**2).sum(axis=1), np.finfo(float).tiny)
    along = np.clip(((point - hull) * ways).sum(axis=1) / lengths, 0.0, 1.0)
    distance = float(np.linalg.norm(hull + along[:, None] * ways - point, axis=1).min())
    turns = ways[:, 0] * (point - hull)[:, 1] - ways[:, 1] * (point - hull)[:, 0]
    return distance if len(hull) > 2 and bool((turns >= 0).all()) else -distance
