"""Compiled kernels on oriented boxes: distance, depth, overlap volume and contact polygon in closed form.

Boxes are centres float64 (n, 3), axes float64 (n, 3, 3) with one unit axis a row, and half extents float64 (n, 3).
"""

from __future__ import annotations

import numba
import numpy as np

from stages.shape.arrays import BoolArray, FloatArray
from stages.shape.geometry.polygons import cut_polygon, polygon_area

SIGNS = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
EDGES = np.array([[a, b] for a in range(8) for b in range(a + 1, 8) if np.abs(SIGNS[a] - SIGNS[b]).sum() == 2])
RIGHT_ANGLE_TOLERANCE = 1e-5
"""Largest distance of the corners of a box from those of a true box, as a share of its diagonal."""
EDGE_AXIS_MARGIN = 1e-3
"""Slightly tilted boxes still touch with their faces: an edge axis must separate them by this share of their size more.
"""
SHRINK_SHARE = 1e-9
"""One of two boxes is shrunk by this share of the other's size before cutting, so that none of their faces coincide."""


def box_corners(centres: FloatArray, axes: FloatArray, halves: FloatArray) -> FloatArray:
    """Return the corners of boxes, float64 (n, 8, 3)."""
    corners: FloatArray = centres[:, None] + np.einsum("ks,ns,nsc->nkc", SIGNS, halves, axes)
    return corners


def recognise_boxes(corners: FloatArray) -> tuple[BoolArray, FloatArray, FloatArray, FloatArray]:
    """Return which sets of eight points (n, 8, 3), in any order, are the corners of a box, bool (n,), and the boxes.

    The shortest way from a corner to another is an edge. The shortest of those perpendicular to it is the second edge,
    and of those perpendicular to both the third. A set that is not a box gets a meaningless one.
    """
    count = len(corners)
    every = np.arange(count)
    centres = corners.mean(axis=1)
    ways = corners[:, 1:] - corners[:, :1]
    lengths = np.linalg.norm(ways, axis=2)
    sizes = np.maximum(lengths.max(axis=1), np.finfo(float).tiny)
    axes, halves = np.empty((count, 3, 3)), np.empty((count, 3))
    allowed = lengths > RIGHT_ANGLE_TOLERANCE * sizes[:, None]
    for axis in range(3):
        chosen = np.argmin(np.where(allowed, lengths, np.inf), axis=1)
        length = np.maximum(lengths[every, chosen], np.finfo(float).tiny)
        axes[:, axis] = ways[every, chosen] / length[:, None]
        halves[:, axis] = length / 2
        along = np.abs(np.einsum("nkc,nc->nk", ways, axes[:, axis]))
        allowed &= along <= RIGHT_ANGLE_TOLERANCE * sizes[:, None]
    local = np.einsum("nkc,nac->nka", corners - centres[:, None], axes)
    signs = local > 0
    codes = np.sort((signs * [4, 2, 1]).sum(axis=2), axis=1)
    near = np.abs(np.abs(local) - halves[:, None]).max(axis=(1, 2)) <= RIGHT_ANGLE_TOLERANCE * sizes
    return near & (codes == np.arange(8)).all(axis=1), centres, axes, halves


@numba.njit(cache=True)
def _separation(ca, ra, ha, cb, rb, hb, favour, normal):
    """Signed gap of two boxes along the axis that parts them best, over faces and pairs of edges; below zero the
    depth. `normal` becomes that axis, from the second box to the first. Returns the gap and the axis: 0 to 2 of the
    first box, 3 to 5 of the second, 6 and above the pairs of edges, which must part them by `favour` of their size
    more than any face does."""
    best, which = -np.inf, -1
    axis = np.empty(3)
    for kind in range(15):
        for c in range(3):
            if kind < 3:
                axis[c] = ra[kind, c]
            elif kind < 6:
                axis[c] = rb[kind - 3, c]
            else:
                u, v = ra[(kind - 6) // 3], rb[(kind - 6) % 3]
                axis[c] = u[(c + 1) % 3] * v[(c + 2) % 3] - u[(c + 2) % 3] * v[(c + 1) % 3]
        length = (axis[0] ** 2 + axis[1] ** 2 + axis[2] ** 2) ** 0.5
        if length < 1e-6:
            continue
        reach, apart = 0.0, 0.0
        for c in range(3):
            axis[c] /= length
            apart += axis[c] * (ca[c] - cb[c])
        for k in range(3):
            reach += ha[k] * abs(axis[0] * ra[k, 0] + axis[1] * ra[k, 1] + axis[2] * ra[k, 2])
            reach += hb[k] * abs(axis[0] * rb[k, 0] + axis[1] * rb[k, 1] + axis[2] * rb[k, 2])
        gap = abs(apart) - reach
        if gap > best + (1e-9 if kind < 6 else favour) * reach:
            best, which = gap, kind
            for c in range(3):
                normal[c] = axis[c] if apart >= 0 else -axis[c]
    return best, which


@numba.njit(cache=True)
def separations(centres, axes, halves, pairs):
    """For each pair (m, 2) the gap along the axis that parts the boxes best, float64 (m,): below zero they overlap,
    and it is the least way, negative, that would free them; above zero no more than their distance."""
    gaps = np.empty(len(pairs))
    normal = np.empty(3)
    for index in range(len(pairs)):
        a, b = pairs[index]
        gaps[index], _ = _separation(centres[a], axes[a], halves[a], centres[b], axes[b], halves[b], 1e-9, normal)
    return gaps


@numba.njit(cache=True)
def _corner(c, r, h, signs, out):
    for k in range(3):
        out[k] = c[k] + signs[0] * h[0] * r[0, k] + signs[1] * h[1] * r[1, k] + signs[2] * h[2] * r[2, k]


@numba.njit(cache=True)
def _corner_distance2(c, r, h, point):
    total = 0.0
    for k in range(3):
        along = abs(r[k, 0] * (point[0] - c[0]) + r[k, 1] * (point[1] - c[1]) + r[k, 2] * (point[2] - c[2])) - h[k]
        if along > 0:
            total += along * along
    return total


@numba.njit(cache=True)
def _edge_distance2(p0, p1, q0, q1):
    """Squared distance of two segments where both nearest points lie inside them; infinite where they do not (then a
    corner is nearest, or nearer still)."""
    a, b, c, d, e = 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(3):
        u, v, w = p1[k] - p0[k], q1[k] - q0[k], p0[k] - q0[k]
        a += u * u
        b += u * v
        c += v * v
        d += u * w
        e += v * w
    det = a * c - b * b
    if det <= 1e-12 * a * c:
        return np.inf
    s, t = (b * e - c * d) / det, (a * e - b * d) / det
    if s < 0 or s > 1 or t < 0 or t > 1:
        return np.inf
    total = 0.0
    for k in range(3):
        way = p0[k] + s * (p1[k] - p0[k]) - q0[k] - t * (q1[k] - q0[k])
        total += way * way
    return total


@numba.njit(cache=True)
def boxes_within(centres, axes, halves, pairs, distance):
    """Which pairs (m, 2) of boxes overlap or are at most `distance` apart, bool (m,); exact."""
    within = np.zeros(len(pairs), dtype=np.bool_)
    normal = np.empty(3)
    one, two = np.empty((8, 3)), np.empty((8, 3))
    limit = distance * distance
    for index in range(len(pairs)):
        a, b = pairs[index]
        gap, _ = _separation(centres[a], axes[a], halves[a], centres[b], axes[b], halves[b], 1e-9, normal)
        if gap <= 0 or gap > distance:
            within[index] = gap <= 0
            continue
        for k in range(8):
            _corner(centres[a], axes[a], halves[a], SIGNS[k], one[k])
            _corner(centres[b], axes[b], halves[b], SIGNS[k], two[k])
            near = _corner_distance2(centres[b], axes[b], halves[b], one[k])
            near = min(near, _corner_distance2(centres[a], axes[a], halves[a], two[k]))
            if near <= limit:
                within[index] = True
                break
        for i in range(12):
            if within[index]:
                break
            for j in range(12):
                if _edge_distance2(one[EDGES[i, 0]], one[EDGES[i, 1]], two[EDGES[j, 0]], two[EDGES[j, 1]]) <= limit:
                    within[index] = True
                    break
    return within


@numba.njit(cache=True)
def _face(c, r, h, axis, sign, polygon):
    """The four corners, in order, of the face of a box at `sign` along `axis`."""
    u, v = (axis + 1) % 3, (axis + 2) % 3
    for k in range(4):
        su = 1.0 if k == 0 or k == 3 else -1.0
        sv = 1.0 if k < 2 else -1.0
        for i in range(3):
            polygon[k, i] = c[i] + sign * h[axis] * r[axis, i] + su * h[u] * r[u, i] + sv * h[v] * r[v, i]


@numba.njit(cache=True)
def _cut_by_box(polygon, count, c, r, h, but, slack, spare):
    """The part of a polygon inside a box, without the sides along axis `but`; in `polygon`; its corner count."""
    for k in range(3):
        if k == but:
            continue
        base = r[k, 0] * c[0] + r[k, 1] * c[1] + r[k, 2] * c[2]
        count = cut_polygon(polygon, count, r[k], 1.0, base + h[k] + slack, spare)
        count = cut_polygon(spare, count, r[k], -1.0, -base + h[k] + slack, polygon)
        if count == 0:
            break
    return count


@numba.njit(cache=True)
def overlap_volumes(centres, axes, halves, pairs):
    """The volume that the boxes of each pair (m, 2) share, float64 (m,): the signed cones from the centre of the
    first to the faces of each, cut by the other."""
    volumes = np.zeros(len(pairs))
    normal = np.empty(3)
    polygon, spare = np.empty((24, 3)), np.empty((24, 3))
    for index in range(len(pairs)):
        a, b = pairs[index]
        gap, _ = _separation(centres[a], axes[a], halves[a], centres[b], axes[b], halves[b], 1e-9, normal)
        if gap >= 0:
            continue
        small = halves[b] - SHRINK_SHARE * (halves[a].max() + halves[b].max())
        total = 0.0
        for side in range(12):
            first = side < 6
            axis, sign = (side % 6) // 2, 1.0 - 2.0 * (side % 2)
            if first:
                _face(centres[a], axes[a], halves[a], axis, sign, polygon)
                count = _cut_by_box(polygon, 4, centres[b], axes[b], small, -1, 0.0, spare)
                n, c, h = axes[a, axis], centres[a], halves[a, axis]
            else:
                _face(centres[b], axes[b], small, axis, sign, polygon)
                count = _cut_by_box(polygon, 4, centres[a], axes[a], halves[a], -1, 0.0, spare)
                n, c, h = axes[b, axis], centres[b], small[axis]
            if count < 3:
                continue
            height = h
            for i in range(3):
                height += sign * n[i] * (c[i] - centres[a, i])
            total += height * polygon_area(polygon, count)
        volumes[index] = max(total / 3, 0.0)
    return volumes


@numba.njit(cache=True)
def box_contacts(centres, axes, halves, pairs, tolerance):
    """Where the boxes of pairs (m, 2), which overlap by no more than `tolerance` and are no further apart, touch.

    Returns rows of the pairs int64 (q,), points float64 (q, 3) and the normals float64 (q, 3) of the contact, from
    the second box to the first: the face that parts them best, cut with the face of the other that looks at it; one
    point between two edges that cross.
    """
    rows = np.empty(16 * len(pairs) + 1, dtype=np.int64)
    points, normals = np.empty((16 * len(pairs) + 1, 3)), np.empty((16 * len(pairs) + 1, 3))
    polygon, spare = np.empty((24, 3)), np.empty((24, 3))
    normal = np.empty(3)
    total = 0
    for index in range(len(pairs)):
        a, b = pairs[index]
        gap, which = _separation(
            centres[a], axes[a], halves[a], centres[b], axes[b], halves[b], EDGE_AXIS_MARGIN, normal
        )
        if gap > tolerance:
            continue
        count = 0
        if which < 6:
            base, other, axis = (a, b, which) if which < 3 else (b, a, which - 3)
            # The normal leads from b to a; the face of the base looks the other way round if the base is a.
            outward = -normal if base == a else normal
            sign = 1.0 if np.dot(axes[base, axis], outward) > 0 else -1.0
            facing, best = 0, 0.0
            for k in range(3):
                along = np.dot(axes[other, k], outward)
                if abs(along) > abs(best) + 1e-9:
                    facing, best = k, along
            count, slack = 0, 1e-9 * halves[base].max()
            while count == 0 and slack <= tolerance:
                _face(centres[other], axes[other], halves[other], facing, 1.0 if best < 0 else -1.0, polygon)
                count = _cut_by_box(polygon, 4, centres[base], axes[base], halves[base], axis, slack, spare)
                slack = tolerance if slack < tolerance else np.inf
            plane = np.dot(axes[base, axis], centres[base]) * sign + halves[base, axis]
            count = cut_polygon(polygon, count, axes[base, axis], sign, plane + tolerance, spare)
            for k in range(count):
                above = (sign * np.dot(axes[base, axis], spare[k]) - plane) / 2
                polygon[k] = spare[k] - above * sign * axes[base, axis]
        else:
            u, v = axes[a, (which - 6) // 3], axes[b, (which - 6) % 3]
            near, far = centres[a].copy(), centres[b].copy()
            for k in range(3):
                if k != (which - 6) // 3:
                    near -= axes[a, k] * halves[a, k] * np.sign(np.dot(axes[a, k], normal))
                if k != (which - 6) % 3:
                    far += axes[b, k] * halves[b, k] * np.sign(np.dot(axes[b, k], normal))
            # Nearest points of the two lines.
            across, way = np.dot(u, v), far - near
            s = (np.dot(way, u) - across * np.dot(way, v)) / (1 - across * across)
            t = across * s - np.dot(way, v)
            polygon[0] = (near + s * u + far + t * v) / 2
            count = 1
        for k in range(count):
            rows[total], points[total], normals[total] = index, polygon[k], normal
            total += 1
    return rows[:total], points[:total], normals[:total]
