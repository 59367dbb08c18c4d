"""Triangulate polygons: quads by the diagonal inside, larger ones by ear clipping."""

from __future__ import annotations

import numpy as np

from stages.shape.arrays import FloatArray, IntArray


def triangulate(vertices: FloatArray, corners: np.ndarray, counts: np.ndarray) -> tuple[IntArray, IntArray]:
    """Triangulate polygons, convex or concave, in their order.

    vertices: float64 (v, 3).
    corners: vertex indices, int (c,), polygon after polygon.
    counts: number of corners of each polygon, int (p,).

    Returns triangles int32 (t, 3), as indices into `corners`, and the polygon of each, int32 (t,). Polygons with fewer
    than three corners have no triangles.
    """
    counts = np.asarray(counts, dtype=np.int64)
    starts = np.cumsum(counts) - counts
    three, four = np.flatnonzero(counts == 3), np.flatnonzero(counts == 4)
    triangles = [starts[three, None] + np.arange(3), *_split_quads(vertices, corners, starts[four])]
    owners = [three, four, four]
    for polygon in np.flatnonzero(counts > 4):
        own = np.arange(starts[polygon], starts[polygon] + counts[polygon])
        ears = np.array(_clip_ears(vertices[corners[own]]))
        triangles.append(own[ears])
        owners.append(np.full(len(ears), polygon))
    owner = np.concatenate(owners)
    order = np.argsort(owner, kind="stable")
    return np.concatenate(triangles)[order].astype(np.int32), owner[order].astype(np.int32)


def _split_quads(vertices: FloatArray, corners: np.ndarray, starts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    own = starts[:, None] + np.arange(4)
    points = vertices[corners[own]]
    normal = np.cross(points[:, 2] - points[:, 0], points[:, 3] - points[:, 1])  # along the area vector, concave or not
    first = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    second = np.cross(points[:, 2] - points[:, 0], points[:, 3] - points[:, 0])
    inside = (np.einsum("ij,ij->i", first, normal) >= 0) & (np.einsum("ij,ij->i", second, normal) >= 0)
    turn = np.where(inside, 0, 1)[:, None]
    halves = (np.array([0, 1, 2]) + turn) % 4, (np.array([0, 2, 3]) + turn) % 4
    return np.take_along_axis(own, halves[0], axis=1), np.take_along_axis(own, halves[1], axis=1)


def _clip_ears(points: FloatArray) -> list[tuple[int, int, int]]:
    """Return triangles of one polygon; a self-intersecting remainder becomes a fan."""
    following = np.roll(points, -1, axis=0)
    normal = np.cross(points, following).sum(axis=0)  # Newell: twice the area vector
    axis = int(np.argmax(np.abs(normal)))
    flat = np.delete(points, axis, axis=1)
    if (normal[axis] < 0) != (axis == 1):  # dropping y turns the plane around
        flat = flat * (1.0, -1.0)
    left = list(range(len(points)))
    triangles = []
    while len(left) > 3:
        ear = next((k for k in range(len(left)) if _is_ear(flat, left, k)), None)
        if ear is None:
            break
        triangles.append((left[ear - 1], left[ear], left[(ear + 1) % len(left)]))
        del left[ear]
    return triangles + [(left[0], left[k], left[k + 1]) for k in range(1, len(left) - 1)]


def _is_ear(flat: FloatArray, left: list[int], k: int) -> bool:
    """Return whether corner `k` turns left and no other corner lies in its triangle."""
    a, b, c = flat[left[k - 1]], flat[left[k]], flat[left[(k + 1) % len(left)]]
    if _turn(a, b, c) <= 0:
        return False
    others = [corner for corner in left if corner not in (left[k - 1], left[k], left[(k + 1) % len(left)])]
    rest = flat[others]
    # a corner that coincides with one of the ear's own does not block it: holes are bridged by doubled corners
    rest = rest[~((rest == a).all(axis=1) | (rest == b).all(axis=1) | (rest == c).all(axis=1))]
    inside = (_turn(a, b, rest) >= 0) & (_turn(b, c, rest) >= 0) & (_turn(c, a, rest) >= 0)
    return not inside.any()


def _turn(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """Return twice the signed area of triangles a, b, c; `c` may be a stack of points."""
    area: FloatArray = (b[0] - a[0]) * (c[..., 1] - a[1]) - (b[1] - a[1]) * (c[..., 0] - a[0])
    return area
