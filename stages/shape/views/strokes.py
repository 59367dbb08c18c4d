"""Strokes: the lines that a person would draw, found between the pixels of a view.

Two neighbouring pixels that show different triangles have one line between them, or none. The surface itself decides.
It is walked across the edges of its triangles from the one pixel towards the other.

- The walk arrives: one surface. A sharp edge on the way is a crease, where the walk crossed it.
- The walk ends at a border or where the surface turns away from the viewer. If the other pixel shows something farther
  back, that end is a contour. If it has the same depth, two surfaces meet: a boundary if they belong to two parts that
  are not pieces of one surface, else a crease if they meet at an angle, and nothing if one plane continues.
- Both surfaces continue under each other: they pass through each other, and the line is where their depths are equal.

So every crossing is known to a fraction of a pixel, a tessellated plane or cylinder has no lines of its own, and hidden
surfaces leave no trace: only what some pixel shows is used. Crossings are then joined inside each square of four pixel
centres into segments of lines.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numba
import numpy as np

from stages.shape.arrays import ByteArray, FloatArray
from stages.shape.views.buffers import Visible
from stages.shape.views.screen import clip_at, eye_depth

CREASE_LINE, BOUNDARY_LINE, CONTOUR_LINE, OUTLINE_LINE = 1, 2, 3, 4
"""Kinds of strokes, the weightier ones with the higher numbers; an outline is a contour against the background."""

MAX_WALK_STEPS = 24
"""Triangles that a walk between two pixels may cross before it counts as ended."""
ROUNDED_TURN_DEGREES = 60.0
"""A smooth surface that turns by more degrees between two visible pixels is a rounded edge, drawn as a crease."""


@dataclass(frozen=True)
class Strokes:
    """Segments of lines.

    ends: (x, y) in pixels of the view, float64 (n, 2, 2)
    kinds: uint8 (n,)
    """

    ends: FloatArray
    kinds: ByteArray


def find_strokes(seen: Visible, crease_angle: float, step: float, shortest: float) -> Strokes:
    """Return the strokes of a view.

    crease_angle: degrees between the normals of two faces above which their edge is drawn
    step: smallest jump in depth that is a contour, pixels
    shortest: connected lines of less total length are left out, pixels
    """
    crossings = _crossings(
        seen.triangles, _triangles(seen), _parts(seen), _thresholds(seen, crease_angle, step), seen.view.projection
    )
    ends, kinds, nodes = _join(*crossings)
    kept = _long_enough(ends, nodes, shortest)
    return Strokes(ends[kept], kinds[kept])


class _Triangles(NamedTuple):
    """All triangles of a view.

    screen: corners on the screen, float64 (t, 3, 3)
    normals: float64 (t, 3)
    faces: face of each triangle in its mesh, (t,)
    neighbours: neighbours of each face of the meshes, or -1, (f, 3)
    """

    screen: np.ndarray
    normals: np.ndarray
    faces: np.ndarray
    neighbours: np.ndarray


class _Parts(NamedTuple):
    """The parts of the triangles.

    of: part of each triangle, (t,)
    shifts: number to add to a face of each part to get its triangle, (n,)
    layers: (n,)
    one_surface: whether parts are pieces of one surface
    """

    of: np.ndarray
    shifts: np.ndarray
    layers: np.ndarray
    one_surface: bool


class _Thresholds(NamedTuple):
    """What makes a line.

    crease: cosine between normals across an edge above which there is a crease
    rounded: the same between two pixels on a smooth surface
    jump: smallest jump in depth that is a contour, in units of the scene; in perspective at a depth of 1, growing with
        the depth
    perspective: whether the view is in perspective
    """

    crease: float
    rounded: float
    jump: float
    perspective: bool


def _triangles(seen: Visible) -> _Triangles:
    return _Triangles(seen.screen, seen.normals, seen.scene.triangle_face, seen.scene.meshes.neighbours)


def _parts(seen: Visible) -> _Parts:
    scene = seen.scene
    shifts = scene.triangle_first[:-1] - scene.meshes.face_first[scene.mesh_of]
    return _Parts(scene.triangle_part, shifts, scene.layers, scene.one_surface)


def _thresholds(seen: Visible, crease_angle: float, step: float) -> _Thresholds:
    pixel = 2.0 / (seen.view.projection[1, 1] * len(seen.triangles))
    return _Thresholds(
        crease=float(np.cos(np.radians(crease_angle))),
        rounded=float(np.cos(np.radians(ROUNDED_TURN_DEGREES))),
        jump=float(step * pixel),
        perspective=seen.view.perspective,
    )


# Functions called for each pair of pixels are inlined: passing arrays would take half of the time.
@numba.njit(cache=True, error_model="numpy", inline="always")
def _side(screen, t, edge, x, y):
    """Return twice the signed area of (x, y) and an edge of the triangle `t` on the screen."""
    end = edge + 1 if edge < 2 else 0
    ax, ay = screen[t, edge, 0], screen[t, edge, 1]
    return (screen[t, end, 0] - ax) * (y - ay) - (screen[t, end, 1] - ay) * (x - ax)


@numba.njit(cache=True, error_model="numpy", inline="always")
def _cosine(normals, a, b):
    """Return the cosine of the angle between the normals of two triangles."""
    return normals[a, 0] * normals[b, 0] + normals[a, 1] * normals[b, 1] + normals[a, 2] * normals[b, 2]


@numba.njit(cache=True, error_model="numpy", inline="always")
def _walk(triangles, shift, crease, start, goal, p, q):
    """Walk on the surface from triangle `start` at the point `p` of the screen straight to the point `q`.

    shift: that of its part

    Returns (arrived, s, last, sharp): whether the walk ended on `goal`; the share of the way where the surface ends (1
    if it reaches q); the last triangle; the share of the way at the sharpest edge above the crease angle, or -1.
    """
    screen, normals, faces, neighbours = triangles
    triangle, entry = start, -1
    s, sharp, sharpest = 0.0, -1.0, crease
    for _ in range(MAX_WALK_STEPS):
        if triangle == goal:
            return True, s, triangle, sharp
        area = _side(screen, triangle, 0, screen[triangle, 2, 0], screen[triangle, 2, 1])
        if area == 0.0:
            return False, s, triangle, sharp
        exit_edge, exit_s = -1, 2.0
        for edge in range(3):
            if edge == entry:
                continue
            at_q = _side(screen, triangle, edge, q[0], q[1]) / area
            if at_q < 0.0:
                at_p = _side(screen, triangle, edge, p[0], p[1]) / area
                crossing = max(at_p / (at_p - at_q), s) if at_p > 0.0 else s
                if crossing < exit_s:
                    exit_edge, exit_s = edge, crossing
        if exit_edge < 0:
            return False, 1.0, triangle, sharp
        s = min(exit_s, 1.0)
        face = neighbours[faces[triangle], exit_edge]
        if face < 0:
            return False, s, triangle, sharp
        following = face + shift
        back = -1
        for edge in range(3):
            if neighbours[face, edge] == faces[triangle]:
                back = edge
        # Where the next triangle lies on the same side of the edge as this one, the surface turns away here.
        corner = (back + 2) % 3
        if _side(screen, triangle, exit_edge, screen[following, corner, 0], screen[following, corner, 1]) / area >= 0.0:
            return False, s, triangle, sharp
        cosine = _cosine(normals, triangle, following)
        if cosine < sharpest:
            sharp, sharpest = s, cosine
        triangle, entry = following, back
    return False, s, triangle, sharp


@numba.njit(cache=True, error_model="numpy", inline="always")
def _between(triangles, parts, thresholds, projection, a, b, p, q):
    """Return kind and position (share of the way from p to q) of the line between two pixels.

    p, q: pixels on the screen
    a, b: triangles that they show, one of them perhaps none
    """
    screen, normals, crease = triangles.screen, triangles.normals, thresholds.crease
    # Numba copies the walk to each of its calls: one serves outlines on both sides, too.
    is_outline, is_turned = a < 0 or b < 0, a < 0
    if is_turned:
        a, p, q = b, q, p
    part_a = parts.of[a]
    part_b = part_a if is_outline else parts.of[b]
    goal_a, goal_b = (b, a) if part_a == part_b and not is_outline else (-1, -1)
    arrived, end_a, last_a, sharp = _walk(triangles, parts.shifts[part_a], crease, a, goal_a, p, q)
    if is_outline:
        return OUTLINE_LINE, 1.0 - end_a if is_turned else end_a
    if arrived:
        return _on_one_surface(normals, thresholds.rounded, a, b, sharp)
    arrived, end_b, last_b, sharp = _walk(triangles, parts.shifts[part_b], crease, b, goal_b, q, p)
    if arrived:
        kind, s = _on_one_surface(normals, thresholds.rounded, b, a, sharp)
        return kind, 1.0 - s
    start_b = 1.0 - end_b
    # How much farther the surface of a is than that of b, where that of b begins and where that of a ends.
    at_start = _gap(screen, projection, last_a, last_b, p, q, start_b)
    at_end = _gap(screen, projection, last_a, last_b, p, q, end_a)
    depth = eye_depth(clip_at(screen, a, p[0], p[1]), projection)
    tolerance = thresholds.jump * (depth if thresholds.perspective else 1.0)
    if start_b >= end_a:
        s, gap = (start_b + end_a) / 2, min(abs(at_start), abs(at_end))
    elif max(abs(at_start), abs(at_end)) < 0.01 * tolerance:
        # Two faces in one plane: the part of the lower layer is seen up to its end.
        s, gap = end_a if parts.layers[part_a] <= parts.layers[part_b] else start_b, 0.0
    elif at_start < 0.0 < at_end:
        s, gap = start_b + (end_a - start_b) * at_start / (at_start - at_end), 0.0
    elif at_start + at_end < 0.0:
        s, gap = end_a, at_end
    else:
        s, gap = start_b, at_start
    if abs(gap) > tolerance:
        return CONTOUR_LINE, s
    if part_a != part_b and not parts.one_surface:
        return BOUNDARY_LINE, s
    if _cosine(normals, last_a, last_b) < crease:
        return CREASE_LINE, s
    return 0, 0.0


@numba.njit(cache=True, error_model="numpy", inline="always")
def _gap(screen, projection, a, b, p, q, s):
    """Return how much farther triangle `a` is than triangle `b` at the share `s` of the way from p to q."""
    x, y = p[0] + s * (q[0] - p[0]), p[1] + s * (q[1] - p[1])
    return eye_depth(clip_at(screen, a, x, y), projection) - eye_depth(clip_at(screen, b, x, y), projection)


@numba.njit(cache=True, error_model="numpy", inline="always")
def _on_one_surface(normals, rounded, a, b, sharp):
    """Return kind and position of the line between two triangles that a walk joins, with `sharp` from the walk."""
    if sharp >= 0.0:
        return CREASE_LINE, sharp
    if normals[a, 2] > 0.3 and normals[b, 2] > 0.3 and _cosine(normals, a, b) < rounded:
        return CREASE_LINE, 0.5
    return 0, 0.0


@numba.njit(cache=True, error_model="numpy", inline="always")
def _runs_on(triangles, crease, a, b):
    """Return whether two triangles of one part share an edge that is neither sharp nor a silhouette.

    Most pairs do, and need no walk.
    """
    screen, normals, faces, neighbours = triangles
    if _cosine(normals, a, b) < crease:
        return False
    for edge in range(3):
        if neighbours[faces[a], edge] == faces[b]:
            for back in range(3):
                if neighbours[faces[b], back] == faces[a]:
                    near, far = (edge + 2) % 3, (back + 2) % 3
                    side = _side(screen, a, edge, screen[a, near, 0], screen[a, near, 1])
                    return side * _side(screen, a, edge, screen[b, far, 0], screen[b, far, 1]) < 0.0
    return False


@numba.njit(cache=True, error_model="numpy")
def _crossings(shown, triangles, parts, thresholds, projection):
    """Find the lines between pixels.

    shown: triangle of each pixel, or -1

    Returns the number of the line between pixel (r, c) and (r, c + 1), or -1, int32 (h, w); that of the line between
    (r, c) and (r + 1, c); and of each line its share of the way, (n,), and its kind, (n,).
    """
    height, width = shown.shape
    across, down = np.full((height, width), -1, dtype=np.int32), np.full((height, width), -1, dtype=np.int32)
    max_lines = _differing(shown)
    shares, kinds = np.empty(max_lines), np.empty(max_lines, dtype=np.uint8)
    total = 0
    for r in range(height):
        for c in range(width):
            a = shown[r, c]
            for way in range(2):
                r2, c2 = r + way, c + 1 - way
                if r2 == height or c2 == width:
                    continue
                b = shown[r2, c2]
                if a == b:
                    continue
                one_part = a >= 0 and b >= 0 and parts.of[a] == parts.of[b]
                if one_part and _runs_on(triangles, thresholds.crease, a, b):
                    continue
                p, q = (c + 0.5, r + 0.5), (c2 + 0.5, r2 + 0.5)
                kind, s = _between(triangles, parts, thresholds, projection, a, b, p, q)
                if kind:
                    shares[total], kinds[total] = s, kind
                    if way == 0:
                        across[r, c] = total
                    else:
                        down[r, c] = total
                    total += 1
    return across, down, shares[:total], kinds[:total]


@numba.njit(cache=True, error_model="numpy")
def _differing(shown):
    """Return how many pairs of neighbouring pixels show different triangles."""
    height, width = shown.shape
    total = 0
    for r in range(height):
        for c in range(width - 1):
            total += shown[r, c] != shown[r, c + 1]
    for r in range(height - 1):
        for c in range(width):
            total += shown[r, c] != shown[r + 1, c]
    return total


@numba.njit(cache=True, error_model="numpy")
def _join(across, down, shares, kinds_of):
    """Join the crossings on the sides of each square of four pixel centres.

    Returns segments (n, 2, 2), their kinds (n,) and the numbers of the nodes at their ends (n, 2).
    """
    height, width = across.shape
    node = len(shares)
    # Each crossing lies between two squares.
    ends = np.empty((2 * node, 2, 2))
    kinds = np.empty(2 * node, dtype=np.uint8)
    nodes = np.empty((2 * node, 2), dtype=np.int32)
    positions, found_kinds, numbers = np.empty((4, 2)), np.empty(4, dtype=np.uint8), np.empty(4, dtype=np.int32)
    total = 0
    for r in range(height - 1):
        for c in range(width - 1):
            # A number is -1 or not negative: so all four are -1.
            if (across[r, c] & across[r + 1, c] & down[r, c] & down[r, c + 1]) == -1:
                continue
            size = np.int64(0)
            for side in range(4):
                row, column = r + (side == 1), c + (side == 3)
                number = across[row, column] if side < 2 else down[row, column]
                if number < 0:
                    continue
                if side < 2:
                    positions[size] = column + 0.5 + shares[number], row + 0.5
                else:
                    positions[size] = column + 0.5, row + 0.5 + shares[number]
                found_kinds[size], numbers[size] = kinds_of[number], number
                size += 1
            if size < 2:
                continue
            if size == 2:
                ends[total, 0], ends[total, 1] = positions[0], positions[1]
                kinds[total], nodes[total, 0], nodes[total, 1] = (
                    min(found_kinds[0], found_kinds[1]),
                    numbers[0],
                    numbers[1],
                )
                total += 1
                continue
            middle = _meeting(positions, found_kinds, size)
            for k in range(size):
                ends[total, 0], ends[total, 1] = positions[k], middle
                kinds[total], nodes[total, 0], nodes[total, 1] = found_kinds[k], numbers[k], node
                total += 1
            node += 1
    return ends[:total], kinds[:total], nodes[:total]


@numba.njit(cache=True, error_model="numpy")
def _meeting(positions, line_kinds, size):
    """Return where three or four lines meet: on the chord of the two weightiest if they outweigh the rest."""
    middle = np.zeros(2)
    heaviest = line_kinds[:size].max()
    chord = 0
    for k in range(size):
        if line_kinds[k] == heaviest:
            chord += 1
    counted = 0
    for k in range(size):
        if chord != 2 or line_kinds[k] == heaviest:
            middle += positions[k]
            counted += 1
    return middle / counted


@numba.njit(cache=True, error_model="numpy")
def _root(parent, node):
    while parent[node] != node:
        parent[node] = parent[parent[node]]
        node = parent[node]
    return node


@numba.njit(cache=True, error_model="numpy")
def _long_enough(ends, nodes, shortest):
    """Return which segments (n,) belong to a connected drawing of at least the length `shortest`."""
    size = nodes.max() + 1 if len(nodes) else 0
    parent = np.arange(size)
    for k in range(len(nodes)):
        a, b = _root(parent, nodes[k, 0]), _root(parent, nodes[k, 1])
        parent[max(a, b)] = min(a, b)
    length = np.zeros(size)
    for k in range(len(nodes)):
        dx, dy = ends[k, 1, 0] - ends[k, 0, 0], ends[k, 1, 1] - ends[k, 0, 1]
        length[_root(parent, nodes[k, 0])] += np.sqrt(dx * dx + dy * dy)
    kept = np.empty(len(nodes), dtype=np.bool_)
    for k in range(len(nodes)):
        kept[k] = length[_root(parent, nodes[k, 0])] >= shortest
    return kept
