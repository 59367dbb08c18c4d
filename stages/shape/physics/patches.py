"""Compiled kernels on pairs of triangle meshes: the polygons on which they touch, and the volume that they share."""

from __future__ import annotations

import numba
import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.geometry.polygons import convex_hull, cut_polygon
from stages.shape.geometry.sorting import sort_values

MIN_OPPOSED_COSINE = 0.98
"""Faces press on each other if their normals are opposed within about 11 degrees."""
LINES_PER_SIDE = 24
"""Lines along each axis, on either side of a square, on which the overlap of two meshes is measured."""


LINE_OFFSETS = np.array([0.0073, 0.0131, 0.0039])


@numba.njit(cache=True)
def _unit_normal(tri, out):
    """Write the unit normal of a triangle into `out`. Returns its double area."""
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        out[k] = (tri[1, i] - tri[0, i]) * (tri[2, j] - tri[0, j]) - (tri[1, j] - tri[0, j]) * (tri[2, i] - tri[0, i])
    length = (out[0] ** 2 + out[1] ** 2 + out[2] ** 2) ** 0.5
    if length > 0:
        for k in range(3):
            out[k] /= length
    return length


@numba.njit(cache=True)
def _sides(tri, n, k, out):
    """Write the normal of the plane through side k of a triangle (normal n), perpendicular to it, into `out`. Returns
    its offset.
    """
    after = (k + 1) % 3
    length = 0.0
    for i in range(3):
        j, m = (i + 1) % 3, (i + 2) % 3
        out[i] = (tri[after, j] - tri[k, j]) * n[m] - (tri[after, m] - tri[k, m]) * n[j]
        length += out[i] * out[i]
    length = max(length, 1e-300) ** 0.5
    offset = 0.0
    for i in range(3):
        out[i] /= length
        offset += out[i] * tri[k, i]
    return offset


@numba.njit(cache=True)
def facing_polygons(ca, cb, pairs, pose, tolerance, oriented):
    """Return the polygons between triangles of two meshes that face each other and are near.

    ca, cb: triangle corners (f, 3, 3)
    pairs: near triangles, int64 (p, 2)
    pose: pose of mesh b in coordinates of a
    oriented: if false, triangles may also face the same way: surfaces without an inside

    Returns points float64 (q, 3), the corners of the polygons, and normals float64 (q, 3) out of mesh a, in coordinates
    of a.
    """
    r, t = pose[:3, :3], pose[:3, 3]
    points, normals = np.empty((10 * len(pairs) + 1, 3)), np.empty((10 * len(pairs) + 1, 3))
    polygon, spare, tri = np.empty((16, 3)), np.empty((16, 3)), np.empty((3, 3))
    na, nb, side = np.empty(3), np.empty(3), np.empty(3)
    total = 0
    for index in range(len(pairs)):
        first = ca[pairs[index, 0]]
        for k in range(3):
            c = cb[pairs[index, 1], k]
            for i in range(3):
                tri[k, i] = r[i, 0] * c[0] + r[i, 1] * c[1] + r[i, 2] * c[2] + t[i]
        if _unit_normal(first, na) <= 0 or _unit_normal(tri, nb) <= 0:
            continue
        facing = na[0] * nb[0] + na[1] * nb[1] + na[2] * nb[2]
        if facing > -MIN_OPPOSED_COSINE and (oriented or facing < MIN_OPPOSED_COSINE):
            continue
        polygon[:3] = first
        count = 3
        for k in range(3):
            offset = _sides(tri, nb, k, side)
            count = cut_polygon(polygon, count, side, 1.0, offset, spare)
            polygon, spare = spare, polygon
            if count == 0:
                break
        base = nb[0] * tri[0, 0] + nb[1] * tri[0, 1] + nb[2] * tri[0, 2]
        count = cut_polygon(polygon, count, nb, 1.0, base + tolerance, spare)
        count = cut_polygon(spare, count, nb, -1.0, -base + tolerance, polygon)
        if count < 3:
            continue
        sign = -1.0 if facing < 0 else 1.0
        length = 0.0
        for i in range(3):
            side[i] = na[i] + sign * nb[i]
            length += side[i] * side[i]
        for k in range(count):
            above = (nb[0] * polygon[k, 0] + nb[1] * polygon[k, 1] + nb[2] * polygon[k, 2] - base) / 2
            for i in range(3):
                points[total, i] = polygon[k, i] - above * nb[i]
                normals[total, i] = side[i] / length**0.5
            total += 1
    return points[:total], normals[:total]


@numba.njit(cache=True)
def _behind(corners, used, r, t, n, base, slack):
    """Return whether any corner of the `used` triangles, moved by r and t, lies deeper than `slack` behind a plane."""
    for u in range(len(corners)):
        if used[u]:
            for k in range(3):
                height = -base
                for i in range(3):
                    moved = t[i]
                    for j in range(3):
                        moved += r[i, j] * corners[u, k, j]
                    height += n[i] * moved
                if height < -slack:
                    return True
    return False


@numba.njit(cache=True)
def touching_edges(ca, cb, pairs, pose, tolerance):
    """Return the ends of the pieces of edges of mesh b on faces of mesh a, with the normals of the faces.

    A face counts if all near triangles of b lie in front of it. Arguments and results are as in `facing_polygons`.
    """
    r, t = pose[:3, :3], pose[:3, 3]
    points, normals = np.empty((6 * len(pairs) + 1, 3)), np.empty((6 * len(pairs) + 1, 3))
    used = np.zeros(len(cb), dtype=np.bool_)
    for index in range(len(pairs)):
        used[pairs[index, 1]] = True
    tri, na, side = np.empty((3, 3)), np.empty(3), np.empty(3)
    piece = np.empty((2, 3))
    total = 0
    for index in range(len(pairs)):
        first = ca[pairs[index, 0]]
        for k in range(3):
            c = cb[pairs[index, 1], k]
            for i in range(3):
                tri[k, i] = r[i, 0] * c[0] + r[i, 1] * c[1] + r[i, 2] * c[2] + t[i]
        if _unit_normal(first, na) <= 0:
            continue
        base = na[0] * first[0, 0] + na[1] * first[0, 1] + na[2] * first[0, 2]
        if _behind(cb, used, r, t, na, base, 2 * tolerance):
            continue
        for k in range(3):
            piece[0], piece[1] = tri[k], tri[(k + 1) % 3]
            low, high = 0.0, 1.0
            for plane in range(4):
                if plane < 3:
                    offset = _sides(first, na, plane, side)
                else:
                    side[:] = na
                    offset = base
                here, there = np.dot(side, piece[0]) - offset - tolerance, np.dot(side, piece[1]) - offset - tolerance
                if here > 0 and there > 0:
                    low = 2.0
                elif here > 0:
                    low = max(low, here / (here - there))
                elif there > 0:
                    high = min(high, here / (here - there))
            if low > high:
                continue
            for share in (low, high):
                points[total] = piece[0] + share * (piece[1] - piece[0])
                normals[total] = na
                total += 1
    return points[:total], normals[:total]


def flat_hulls(points: FloatArray, normals: FloatArray, tolerance: float) -> tuple[FloatArray, FloatArray]:
    """Return corners and normals of the fewest flat patches equivalent to pressure on all of `points` (q, 3).

    Points with similar normals in one plane within `tolerance` make one patch, the convex hull: pressure inside it
    equals pressure at its corners.
    """
    kept_points, kept_normals = [], []
    left = np.arange(len(points))
    while len(left):
        normal = normals[left[0]]
        height = (points[left] - points[left[0]]) @ normal
        alike = (normals[left] @ normal > MIN_OPPOSED_COSINE) & (np.abs(height) <= 2 * tolerance)
        chosen = points[left[alike]]
        corners = chosen[hull_corners(chosen, normal)]
        kept_points.append(corners)
        kept_normals.append(np.broadcast_to(normal, corners.shape))
        left = left[~alike]
    if not kept_points:
        return np.empty((0, 3)), np.empty((0, 3))
    return np.concatenate(kept_points), np.concatenate(kept_normals)


def hull_corners(points: FloatArray, normal: FloatArray) -> np.ndarray:
    """Return the indices of the corners of the convex hull of points (q, 3) seen along `normal`, in order."""
    first = np.eye(3)[np.argmin(np.abs(normal))]
    u = np.cross(normal, first)
    flat = np.column_stack([points @ u, points @ np.cross(normal, u)])
    return convex_hull(flat)


@numba.njit(cache=True)
def _crossings(corners, axis, low, step, columns, out, counts):
    """Write where lines along `axis` cross the triangles of a mesh into `out` (columns, columns, room), with `counts`.

    Lines are at low + (index + 1/2) step in the two other axes.
    """
    u, v = (axis + 1) % 3, (axis + 2) % 3
    counts[:] = 0
    for f in range(len(corners)):
        tri = corners[f]
        i0 = int(np.ceil((min(tri[0, u], tri[1, u], tri[2, u]) - low[u]) / step[u] - 0.5))
        i1 = int(np.floor((max(tri[0, u], tri[1, u], tri[2, u]) - low[u]) / step[u] - 0.5))
        j0 = int(np.ceil((min(tri[0, v], tri[1, v], tri[2, v]) - low[v]) / step[v] - 0.5))
        j1 = int(np.floor((max(tri[0, v], tri[1, v], tri[2, v]) - low[v]) / step[v] - 0.5))
        det = (tri[1, u] - tri[0, u]) * (tri[2, v] - tri[0, v]) - (tri[1, v] - tri[0, v]) * (tri[2, u] - tri[0, u])
        if det == 0:
            continue
        for i in range(max(i0, 0), min(i1, columns - 1) + 1):
            x = low[u] + (i + 0.5) * step[u] - tri[0, u]
            for j in range(max(j0, 0), min(j1, columns - 1) + 1):
                y = low[v] + (j + 0.5) * step[v] - tri[0, v]
                b = (x * (tri[2, v] - tri[0, v]) - y * (tri[2, u] - tri[0, u])) / det
                c = (y * (tri[1, u] - tri[0, u]) - x * (tri[1, v] - tri[0, v])) / det
                if b < 0 or c < 0 or b + c > 1 or counts[i, j] >= out.shape[2]:
                    continue
                height = tri[0, axis] + b * (tri[1, axis] - tri[0, axis]) + c * (tri[2, axis] - tri[0, axis])
                out[i, j, counts[i, j]] = height
                counts[i, j] += 1


@numba.njit(cache=True)
def overlap(ca, cb, pose, low, high):
    """Return the volume that two closed meshes share in the box from `low` to `high`, and a lower bound of their depth.

    Coordinates are those of the first mesh. The volume is measured on LINES_PER_SIDE x LINES_PER_SIDE lines along each
    axis: exact along the lines, sampled across them. A layer of overlap has, along some axis, no stretch longer than
    sqrt(3) times its thickness.
    """
    r, t = pose[:3, :3], pose[:3, 3]
    moved = np.empty_like(cb)
    for f in range(len(cb)):
        for k in range(3):
            for i in range(3):
                moved[f, k, i] = r[i, 0] * cb[f, k, 0] + r[i, 1] * cb[f, k, 1] + r[i, 2] * cb[f, k, 2] + t[i]
    # A little off the middle, along each axis by another share, so that no line meets the edges of a symmetric part.
    step = (high - low) / (LINES_PER_SIDE + 0.02)
    start = low + LINE_OFFSETS * step
    heights_a, heights_b = (
        np.empty((LINES_PER_SIDE, LINES_PER_SIDE, 64)),
        np.empty((LINES_PER_SIDE, LINES_PER_SIDE, 64)),
    )
    count_one = np.zeros((LINES_PER_SIDE, LINES_PER_SIDE), dtype=np.int64)
    count_two = np.zeros((LINES_PER_SIDE, LINES_PER_SIDE), dtype=np.int64)
    volume, depth = 0.0, np.inf
    for axis in range(3):
        _crossings(ca, axis, start, step, LINES_PER_SIDE, heights_a, count_one)
        _crossings(moved, axis, start, step, LINES_PER_SIDE, heights_b, count_two)
        longest, sum_of = 0.0, 0.0
        for i in range(LINES_PER_SIDE):
            for j in range(LINES_PER_SIDE):
                p, q = count_one[i, j], count_two[i, j]
                if p < 2 or q < 2 or p % 2 == 1 or q % 2 == 1:
                    continue
                a, b = heights_a[i, j, :p], heights_b[i, j, :q]
                sort_values(a)
                sort_values(b)
                for x in range(0, p, 2):
                    for y in range(0, q, 2):
                        shared = min(a[x + 1], b[y + 1]) - max(a[x], b[y])
                        if shared > 0:
                            longest = max(longest, shared)
                            sum_of += shared
        volume += sum_of * step[(axis + 1) % 3] * step[(axis + 2) % 3] / 3
        depth = min(depth, longest)
    return volume, depth / 3**0.5
