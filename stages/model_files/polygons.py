"""Triangulate polygons: quads by the diagonal inside, larger ones by ear clipping."""

from __future__ import annotations

import itertools

import numpy as np

from stages.shape.arrays import FloatArray, IntArray
from stages.shape.geometry.distinct_rows import distinct_rows


def triangulate(vertices: FloatArray, corners: np.ndarray, counts: np.ndarray) -> tuple[IntArray, IntArray]:
    """Triangulate polygons, convex or concave, in their order.

    A polygon with the corners of an earlier one, in the same or the opposite order from any corner, is triangulated
    like that one, so that two-sided surfaces have the same triangles on both sides.

    vertices: float64 (v, 3).
    corners: vertex indices, int (c,), polygon after polygon.
    counts: number of corners of each polygon, int (p,).

    Returns triangles int32 (t, 3), as indices into `corners`, and the polygon of each, int32 (t,). Polygons with fewer
    than three corners have no triangles.
    """
    counts = np.asarray(counts, dtype=np.int64)
    starts = np.cumsum(counts) - counts
    model, places = _repeated(vertices, corners, starts, counts)
    is_own = model == np.arange(len(counts))
    three, four = np.flatnonzero(counts == 3), np.flatnonzero((counts == 4) & is_own)
    triangles = [starts[three, None] + np.arange(3), *_split_quads(vertices, corners, starts[four])]
    owners = [three, four, four]
    for polygon in np.flatnonzero((counts > 4) & is_own):
        own = np.arange(starts[polygon], starts[polygon] + counts[polygon])
        ears = np.array(_clip_ears(vertices[corners[own]]))
        triangles.append(own[ears])
        owners.append(np.full(len(ears), polygon))
    if places:
        triangles_of: dict[int, list[np.ndarray]] = {}
        wanted = set(model[list(places)].tolist())
        for first, triangle in zip(np.concatenate(owners).tolist(), np.concatenate(triangles), strict=True):
            if first in wanted:
                triangles_of.setdefault(first, []).append(triangle)
        for copy, place in places.items():
            of_model = np.array(triangles_of[int(model[copy])]) - starts[model[copy]]
            is_reversed = (place[1] - place[0]) % len(place) != 1
            triangles.append(starts[copy] + place[of_model[:, ::-1] if is_reversed else of_model])
            owners.append(np.full(len(of_model), copy))
    owner = np.concatenate(owners)
    order = np.argsort(owner, kind="stable")
    return np.concatenate(triangles)[order].astype(np.int32), owner[order].astype(np.int32)


def bridge_holes(points: FloatArray, holes: list[FloatArray]) -> np.ndarray:
    """Return a polygon with holes as one ring of corners: indices into the corners of `points` and then of each hole.

    points: float64 (n, 3), the outline; holes: float64 (m, 3) each, in either direction.
    Each hole is joined to the ring by its shortest bridge that crosses nothing, which is passed in both directions.
    """
    flat = _flattened(points, np.concatenate([points, *holes]))
    ring = list(range(len(points)))
    outline = _signed_area(flat[ring])
    ends = np.cumsum([len(points), *map(len, holes)]).tolist()
    loops = [list(range(start, end)) for start, end in itertools.pairwise(ends) if end > start]
    loops = [loop if _signed_area(flat[loop]) * outline < 0 else loop[::-1] for loop in loops]
    while loops:
        sides = [(loop[k - 1], loop[k]) for loop in [ring, *loops] for k in range(len(loop))]
        bridges = sorted(
            (float(np.linalg.norm(flat[corner] - flat[ring[place]])), number, at, place)
            for number, loop in enumerate(loops)
            for at, corner in enumerate(loop)
            for place in range(len(ring))
        )
        _, number, at, place = next(
            (
                bridge
                for bridge in bridges
                if not any(_cross(flat, (loops[bridge[1]][bridge[2]], ring[bridge[3]]), side) for side in sides)
            ),
            bridges[0],
        )
        loop = loops.pop(number)
        ring[place + 1 : place + 1] = [*loop[at:], *loop[: at + 1], ring[place]]
    return np.array(ring)


def _cross(flat: FloatArray, first: tuple[int, int], second: tuple[int, int]) -> bool:
    """Return whether two segments cross; those with an end at the same position do not."""
    a, b, c, d = (flat[corner] for corner in (*first, *second))
    if any((p == q).all() for p in (a, b) for q in (c, d)):
        return False
    return bool(_turn(a, b, c) * _turn(a, b, d) <= 0 and _turn(c, d, a) * _turn(c, d, b) <= 0)


def _signed_area(flat: FloatArray) -> float:
    x, y = flat.T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


def _repeated(
    vertices: FloatArray, corners: np.ndarray, starts: np.ndarray, counts: np.ndarray
) -> tuple[np.ndarray, dict[int, np.ndarray]]:
    """Return for each polygon the first one with its corners in either direction, int (p,).

    Also return, for each repeated polygon, its corner at each corner of the first one. Triangles count as their own.
    """
    model, places = np.arange(len(counts)), {}
    large = np.flatnonzero(counts > 3)
    if not len(large):
        return model, {}
    position = distinct_rows(vertices).numbers
    for count in np.unique(counts[large]).tolist():
        same_count = np.flatnonzero(counts == count)
        rings = position[corners[starts[same_count, None] + np.arange(count)]]
        first, group = distinct_rows(np.sort(rings, axis=1))
        earlier = first[group]
        for index in np.flatnonzero(earlier != np.arange(len(rings))).tolist():
            place = _place_in_ring(rings[earlier[index]].tolist(), rings[index].tolist())
            if place is not None:
                model[same_count[index]] = same_count[earlier[index]]
                places[int(same_count[index])] = place
    return model, places


def _place_in_ring(first: list[int], second: list[int]) -> np.ndarray | None:
    """Return the place in `second` of each item of `first`; None unless one is the other turned or reversed."""
    if len(set(first)) < len(first):
        return None
    begin = second.index(first[0])
    for step in (1, -1):
        place = (begin + step * np.arange(len(first))) % len(first)
        if [second[index] for index in place.tolist()] == first:
            return place
    return None


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
    flat = _flattened(points, points)
    left = list(range(len(points)))
    triangles = []
    while len(left) > 3:
        ear = next((k for k in range(len(left)) if _is_ear(flat, left, k)), None)
        if ear is None:
            break
        triangles.append((left[ear - 1], left[ear], left[(ear + 1) % len(left)]))
        del left[ear]
    return triangles + [(left[0], left[k], left[k + 1]) for k in range(1, len(left) - 1)]


def _flattened(outline: FloatArray, points: FloatArray) -> FloatArray:
    """Return points (n, 2) without the axis that is most across an outline, such that the outline turns left."""
    following = np.roll(outline, -1, axis=0)
    normal = np.cross(outline, following).sum(axis=0)  # Newell: twice the area vector
    axis = int(np.argmax(np.abs(normal)))
    flat: FloatArray = np.delete(points, axis, axis=1)
    return flat * (1.0, -1.0) if (normal[axis] < 0) != (axis == 1) else flat  # dropping y turns the plane around


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
