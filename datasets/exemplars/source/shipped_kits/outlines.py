"""Plane polygons: outlines of kit parts, and their triangulation by ear clipping."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from stages.shape.arrays import FloatArray

Corners = Sequence[Sequence[float]]
"""Points in a plane, as Python's numbers: one at a time, those of an array take five times as long."""

FLAT_AREA = 1e-9
"""Smaller areas count as zero, so that the last bits of a sine never choose a diagonal."""


def rectangle(width: float, height: float, x: float = 0.0, y: float = 0.0) -> FloatArray:
    """Return the corners (4, 2), counter-clockwise, of a rectangle with centre (x, y)."""
    a, b = width / 2, height / 2
    return np.array([[x - a, y - b], [x + a, y - b], [x + a, y + b], [x - a, y + b]])


def chamfered(width: float, height: float, cut: float, x: float = 0.0, y: float = 0.0) -> FloatArray:
    """Return the corners (8, 2) of a rectangle whose corners are cut off at 45 degrees, `cut` from each corner."""
    a, b = width / 2, height / 2
    corners = [(a, cut - b), (a, b - cut), (a - cut, b), (cut - a, b)]
    corners += [(-u, -v) for u, v in corners]
    placed: FloatArray = np.array(corners) + np.array([x, y])
    return placed


def regular(sides: int, apothem: float, turn: float = 0.0) -> FloatArray:
    """Return the corners (sides, 2) of a regular polygon with the middle of one side at angle `turn` (degrees)."""
    angles = np.radians(turn + (np.arange(sides) - 0.5) * 360.0 / sides)
    corners: FloatArray = np.stack([np.cos(angles), np.sin(angles)], axis=1) * (apothem / np.cos(np.pi / sides))
    return corners


def arch(width: float, height: float, rise: float, segments: int = 6, y: float = 0.0) -> FloatArray:
    """Return the corners of an opening: sill centred on (0, y), upright sides, elliptic head of height `rise`."""
    angles = np.linspace(0.0, np.pi, segments + 1)
    head = np.stack([np.cos(angles) * width / 2, np.sin(angles) * rise + height - rise], axis=1)
    sill = np.array([[-width / 2, 0.0], [width / 2, 0.0]])
    placed: FloatArray = np.concatenate([sill, head]) + np.array([0.0, y])
    return placed


def mirrored(*right: tuple[float, float]) -> FloatArray:
    """Return the outline that is symmetric in x, from its right half, listed from the bottom to the top."""
    return np.array([*right, *[(-x, y) for x, y in right[::-1]]])


def grown(outline: FloatArray, distance: float) -> FloatArray:
    """Move every side of a convex counter-clockwise outline outward by `distance` (inward if negative)."""
    along = np.roll(outline, -1, axis=0) - outline
    normals = np.stack([along[:, 1], -along[:, 0]], axis=1) / np.linalg.norm(along, axis=1)[:, None]
    before = np.roll(normals, 1, axis=0)
    spread = 1.0 + (normals * before).sum(axis=1)
    moved: FloatArray = outline + distance * (normals + before) / spread[:, None]
    return moved


def triangulate(points: FloatArray, loops: Sequence[Sequence[int]]) -> list[tuple[int, int, int]]:
    """Return the triangles of a polygon with holes, as triples of indices into `points` (n, 2).

    loops: the first runs counter-clockwise around the outside, the others clockwise around the holes

    The ear with the shortest diagonal is cut first. Raises ValueError for a loop that crosses itself or runs the wrong
    way round.
    """
    corners: Corners = points.tolist()
    ring = list(loops[0])
    holes = sorted(loops[1:], key=lambda hole: (-max(round(corners[i][0], 6) for i in hole), list(hole)))
    for hole in holes:
        ring = _bridged(corners, ring, hole, holes)
    triangles: list[tuple[int, int, int]] = []
    while len(ring) > 3:
        ears = [k for k in range(len(ring)) if _is_ear(corners, ring, k)]
        if not ears:
            raise ValueError("the outline crosses itself or runs clockwise")
        size = len(ring)
        best = min(ears, key=lambda k: (round(_gap(corners, ring[k - 1], ring[(k + 1) % size]), 6), k))
        triangles.append((ring[best - 1], ring[best], ring[(best + 1) % size]))
        del ring[best]
    if _side(corners, *ring) < -FLAT_AREA:
        raise ValueError("the outline crosses itself or runs clockwise")
    triangles.append((ring[0], ring[1], ring[2]))
    return triangles


def _bridged(points: Corners, ring: list[int], hole: Sequence[int], holes: Sequence[Sequence[int]]) -> list[int]:
    """Connect a ring to a hole along the shortest segment that crosses nothing."""
    loops = [ring, *holes]
    sides = [(loop[k - 1], loop[k]) for loop in loops for k in range(len(loop))]
    candidates = sorted(
        (round(_gap(points, ring[r], hole[h]), 6), r, h) for r in range(len(ring)) for h in range(len(hole))
    )
    for _, r, h in candidates:
        start, end = ring[r], hole[h]
        before, after = ring[r - 1], ring[(r + 1) % len(ring)]
        left = _side(points, before, start, end) > FLAT_AREA, _side(points, start, after, end) > FLAT_AREA
        inward = all(left) if _side(points, before, start, after) > FLAT_AREA else any(left)
        if inward and not any(_crosses(points, start, end, a, b) for a, b in sides):
            return [*ring[: r + 1], *hole[h:], *hole[: h + 1], *ring[r:]]
    raise ValueError("a hole cannot be reached from the outline")


def _is_ear(points: Corners, ring: list[int], k: int) -> bool:
    a, b, c = ring[k - 1], ring[k], ring[(k + 1) % len(ring)]
    if _side(points, a, b, c) <= FLAT_AREA:
        return False
    for other in ring:
        at_corner = other in (a, b, c) or any(_gap(points, other, corner) < 1e-7 for corner in (a, b, c))
        if not at_corner and min(_side(points, *side, other) for side in ((a, b), (b, c), (c, a))) >= -FLAT_AREA:
            return False
    return True


def _crosses(points: Corners, a: int, b: int, c: int, d: int) -> bool:
    """Return whether the open segment a-b meets c-d; sides that end in a or b do not count."""
    if a in (c, d) or b in (c, d):
        return False
    first, second = _side(points, a, b, c), _side(points, a, b, d)
    third, fourth = _side(points, c, d, a), _side(points, c, d, b)
    return (first > FLAT_AREA) != (second > FLAT_AREA) and (third > FLAT_AREA) != (fourth > FLAT_AREA)


def _side(points: Corners, a: int, b: int, c: int) -> float:
    """Return twice the signed area of the triangle a, b, c."""
    p, q, r = points[a], points[b], points[c]
    return (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])


def _gap(points: Corners, a: int, b: int) -> float:
    return math.dist(points[a], points[b])
