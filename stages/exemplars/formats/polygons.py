"""Polygons to triangles: quads by the diagonal that stays inside, larger ones by clipping ears."""

from __future__ import annotations

import numpy as np

from stages.shape.arrays import FloatArray, IntArray


def triangulate(vertices: FloatArray, corners: np.ndarray, counts: np.ndarray) -> tuple[IntArray, IntArray]:
    """Triangles of polygons, concave ones too, in the order of the polygons.

    vertices: float64 (v, 3); corners: (c,) vertex indices, polygon after polygon; counts: (p,) corners of each.
    Returns triangles int32 (t, 3), as places in `corners`, and int32 (t,), the polygon of each. Polygons of fewer
    than three corners have no triangles.
    """
    counts = np.asarray(counts, dtype=np.int64)
    starts = np.cumsum(counts) - counts
    three, four = np.flatnonzero(counts == 3), np.flatnonzero(counts == 4)
    triangles = [starts[three, None] + np.arange(3), *_split_quads(vertices, corners, starts[four])]
    owners = [three, four, four]
    for polygon in np.flatnonzero(counts > 4):
        place = np.arange(starts[polygon], starts[polygon] + counts[polygon])
        ears = np.array(_clip_ears(vertices[corners[place]]))
        triangles.append(place[ears])
        owners.append(np.full(len(ears), polygon))
    owner = np.concatenate(owners)
    order = np.argsort(owner, kind="stable")
    return np.concatenate(triangles)[order].astype(np.int32), owner[order].astype(np.int32)


def _split_quads(vertices: FloatArray, corners: np.ndarray, starts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    place = starts[:, None] + np.arange(4)
    points = vertices[corners[place]]
    normal = np.cross(points[:, 2] - points[:, 0], points[:, 3] - points[:, 1])  # along the area vector, concave or not
    first = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    second = np.cross(points[:, 2] - points[:, 0], points[:, 3] - points[:, 0])
    inside = (np.einsum("ij,ij->i", first, normal) >= 0) & (np.einsum("ij,ij->i", second, normal) >= 0)
    turn = np.where(inside, 0, 1)[:, None]
    one = np.take_along_axis(place, (np.array([0, 1, 2]) + turn) % 4, axis=1)
    two = np.take_along_axis(place, (np.array([0, 2, 3]) + turn) % 4, axis=1)
    return one, two


def _clip_ears(points: FloatArray) -> list[tuple[int, int, int]]:
    """Triangles of one polygon; what crosses itself is closed by a fan."""
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
    """Whether corner `k` turns left and no other corner lies in its triangle."""
    a, b, c = flat[left[k - 1]], flat[left[k]], flat[left[(k + 1) % len(left)]]
    if _turn(a, b, c) <= 0:
        return False
    others = [place for place in left if place not in (left[k - 1], left[k], left[(k + 1) % len(left)])]
    rest = flat[others]
    # a corner that coincides with one of the ear's own does not block it: holes are bridged by doubled corners
    rest = rest[~((rest == a).all(axis=1) | (rest == b).all(axis=1) | (rest == c).all(axis=1))]
    inside = (_turn(a, b, rest) >= 0) & (_turn(b, c, rest) >= 0) & (_turn(c, a, rest) >= 0)
    return not inside.any()


def _turn(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """Twice the signed area of triangles a, b, c; `c` may be a stack of points."""
    area: FloatArray = (b[0] - a[0]) * (c[..., 1] - a[1]) - (b[1] - a[1]) * (c[..., 0] - a[0])
    return area
