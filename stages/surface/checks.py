"""Exact facts about the surface of a mesh: is it closed, is it a manifold, does it intersect itself?

The numbers are those of the GLB: vertices rounded to 32 bits. Vertices at one place are one vertex.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from stages.shape.arrays import FloatArray, IntArray
from stages.shape.geometry.components import connected_components
from stages.shape.geometry.mesh_pairs import build_tree, near_pairs
from stages.shape.kit import PartMesh
from stages.surface.predicates import Point, exact_points, normal, orientation, same_side, segment_meets_triangle

CANDIDATE_GAP_SHARE = 1e-9
"""Pairs of faces that are this share of the diagonal apart, or less, are tested exactly."""
ROUNDING_BOUND = 6e-14
"""Largest error of a determinant in 64-bit numbers, as a share of the product of its longest entries; generous."""


@dataclass(frozen=True)
class SurfaceFlags:
    """Facts about the surface of a part.

    closed: every edge is used equally often in both directions, so that the surface has an inside
    manifold: at most two faces meet at each edge, turned alike, the faces at each vertex form one fan, and no face is
        there twice or without area
    self_intersecting: two faces have a point in common that is no vertex or edge of both
    """

    closed: bool
    manifold: bool
    self_intersecting: bool


@lru_cache(maxsize=512)
def surface_flags(mesh: PartMesh) -> SurfaceFlags:
    """Return the facts about the surface of a mesh."""
    vertices, faces = welded(mesh)
    points = exact_points(vertices)
    with_area = np.array([any(normal(*(points[corner] for corner in face))) for face in faces.tolist()], dtype=bool)
    intersecting = bool(with_area.any()) and _intersects_itself(vertices, faces[with_area], points)
    return SurfaceFlags(_is_closed(faces), bool(with_area.all()) and _is_manifold(faces), intersecting)


def welded(mesh: PartMesh) -> tuple[FloatArray, IntArray]:
    """Return vertices as the GLB has them, each place once, float64 (v, 3), and faces, int32 (f, 3)."""
    stored = mesh.vertices.astype(np.float32).astype(np.float64) + 0.0
    vertices, index = np.unique(stored, axis=0, return_inverse=True)
    return vertices, index.reshape(-1)[mesh.faces].astype(np.int32)


def _is_closed(faces: IntArray) -> bool:
    starts, ends = faces.ravel().astype(np.int64), np.roll(faces, -1, axis=1).ravel().astype(np.int64)
    count = int(faces.max()) + 1
    real = starts != ends
    forth, back = np.sort(starts[real] * count + ends[real]), np.sort(ends[real] * count + starts[real])
    return bool(np.array_equal(forth, back))


def _is_manifold(faces: IntArray) -> bool:
    """Return whether faces with area form a manifold, with a border or without."""
    starts, ends = faces.ravel().astype(np.int64), np.roll(faces, -1, axis=1).ravel().astype(np.int64)
    count = int(faces.max()) + 1
    directed = starts * count + ends
    if len(np.unique(directed)) < len(directed):
        return False
    # across an edge, the corner at its start is one with the corner after the start of its opposite
    corner = np.arange(faces.size)
    after = corner - corner % 3 + (corner + 1) % 3
    order = np.argsort(directed)
    place = np.minimum(np.searchsorted(directed[order], ends * count + starts), len(order) - 1)
    opposite = order[place]
    paired = directed[opposite] == ends * count + starts
    joined = np.column_stack([corner[paired], after[opposite[paired]]])
    fans = connected_components(faces.size, joined)
    return int(fans.max()) + 1 == len(np.unique(faces))


def _intersects_itself(vertices: FloatArray, faces: IntArray, points: Sequence[Point]) -> bool:
    tree = build_tree(vertices, faces)
    numbers = {tuple(vertex): index for index, vertex in enumerate(vertices.tolist())}
    ordered = np.array([[numbers[tuple(corner)] for corner in face] for face in tree[0].tolist()], dtype=np.int64)
    size = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    pairs = near_pairs(tree, tree, np.eye(4), CANDIDATE_GAP_SHARE * size)
    pairs = pairs[pairs[:, 0] < pairs[:, 1]]
    for first, second in pairs[_undecided(vertices, ordered, pairs)].tolist():
        if _faces_meet(ordered[first].tolist(), ordered[second].tolist(), points):
            return True
    return False


def _undecided(vertices: FloatArray, faces: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    """Return which pairs of faces rounded numbers do not prove to meet in shared vertices alone, bool (p,).

    A face surely on one side of the plane of the other, but for the vertices that they share, meets it nowhere else.
    """
    undecided = np.ones(len(pairs), dtype=bool)
    for own, other in ((0, 1), (1, 0)):
        plane, tested = faces[pairs[:, own]], faces[pairs[:, other]]
        a, b, c = (vertices[plane[:, corner]] for corner in range(3))
        across = np.cross(b - a, c - a)
        offsets = vertices[tested] - a[:, None]
        sides = np.einsum("pk,pck->pc", across, offsets)
        product = np.abs(b - a).max(axis=1) * np.abs(c - a).max(axis=1)
        bound = ROUNDING_BOUND * product[:, None] * np.abs(offsets).max(axis=2)
        shared = (tested[:, :, None] == plane[:, None, :]).any(axis=2)
        above, below = ((sides > bound) | shared).all(axis=1), ((sides < -bound) | shared).all(axis=1)
        undecided &= ~((above | below) & ~shared.all(axis=1))
    return undecided


def _faces_meet(first: list[int], second: list[int], points: Sequence[Point]) -> bool:
    """Return whether two faces with area have a point in common that is no vertex or edge of both."""
    shared = [vertex for vertex in first if vertex in second]
    if len(shared) == 3:
        return True
    one, two = [points[vertex] for vertex in first], [points[vertex] for vertex in second]
    if len(shared) == 2:
        u, v = points[shared[0]], points[shared[1]]
        a = points[next(vertex for vertex in first if vertex not in shared)]
        b = points[next(vertex for vertex in second if vertex not in shared)]
        return orientation(u, v, a, b) == 0 and same_side(u, v, a, b)
    if len(shared) == 1:
        facing = [[points[vertex] for vertex in face if vertex != shared[0]] for face in (first, second)]
        (b, c), (e, f) = facing
        return segment_meets_triangle(b, c, two) or segment_meets_triangle(e, f, one)
    return any(
        segment_meets_triangle(edges[index], edges[(index + 1) % 3], other)
        for edges, other in ((one, two), (two, one))
        for index in range(3)
    )
