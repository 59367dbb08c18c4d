"""Compiled kernels on pairs of triangle meshes: box trees, triangle distance, pairs within a tolerance.

A mesh is a tuple `(corners, boxes, links)`:
corners: triangle corners in tree order, float64 (f, 3, 3)
boxes: node boxes as centre and half extents, float64 (k, 6)
links: int64 (k, 2), `(-first - 1, count)` for a leaf, else the indices of the two children; the root is node 0
"""

from __future__ import annotations

import numba
import numpy as np

from stages.shape.arrays import FloatArray, IntArray
from stages.shape.geometry.polygons import cut_polygon, polygon_area
from stages.shape.geometry.sorting import sort_order

MAX_LEAF_TRIANGLES = 4
SLIVER_SHARE = 1e-7
"""A triangle whose height is less than this share of its length is a line to `distances_to_surface`."""

Tree = tuple[FloatArray, FloatArray, np.ndarray]


def build_tree(vertices: FloatArray, faces: IntArray) -> Tree:
    """Return the box tree of a mesh, by median split along the longest axis of the triangle centres."""
    corners = np.ascontiguousarray(vertices[faces])
    order, boxes, links = _split(corners.min(axis=1), corners.max(axis=1))
    return np.ascontiguousarray(corners[order]), boxes, links


@numba.njit(cache=True)
def _split(low, high):
    """Return the order of the triangles, boxes and links of the tree over triangles with these lowest and highest
    corners.
    """
    count = len(low)
    order, centres = np.arange(count), (low + high) / 2
    boxes, links = np.empty((2 * count + 1, 6)), np.zeros((2 * count + 1, 2), dtype=np.int64)
    # the stack is as deep as the tree, whose halves differ by one triangle at most
    waiting = np.empty((128, 4), dtype=np.int64)
    waiting[0] = 0, count, -1, 0
    depth, nodes = 1, 0
    while depth > 0:
        depth -= 1
        begin, end, parent, side = waiting[depth]
        node = nodes
        nodes += 1
        if parent >= 0:
            links[parent, side] = node
        longest, axis = -1.0, 0
        for k in range(3):
            bottom, top, low_centre, high_centre = np.inf, -np.inf, np.inf, -np.inf
            for index in range(begin, end):
                face = order[index]
                bottom, top = min(bottom, low[face, k]), max(top, high[face, k])
                low_centre, high_centre = min(low_centre, centres[face, k]), max(high_centre, centres[face, k])
            boxes[node, k], boxes[node, 3 + k] = (bottom + top) / 2, (top - bottom) / 2
            if high_centre - low_centre > longest:
                longest, axis = high_centre - low_centre, k
        if end - begin <= MAX_LEAF_TRIANGLES:
            links[node] = -begin - 1, end - begin
            continue
        own = order[begin:end].copy()
        order[begin:end] = own[sort_order(centres[own, axis])]
        middle = begin + (end - begin) // 2
        waiting[depth] = middle, end, node, 1
        waiting[depth + 1] = begin, middle, node, 0
        depth += 2
    return order, boxes[:nodes].copy(), links[:nodes].copy()


@numba.njit(cache=True, inline="always")
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@numba.njit(cache=True)
def _segment_distance2(p0, p1, q0, q1):
    """Return the squared distance of two segments."""
    d1x, d1y, d1z = p1[0] - p0[0], p1[1] - p0[1], p1[2] - p0[2]
    d2x, d2y, d2z = q1[0] - q0[0], q1[1] - q0[1], q1[2] - q0[2]
    rx, ry, rz = p0[0] - q0[0], p0[1] - q0[1], p0[2] - q0[2]
    a = d1x * d1x + d1y * d1y + d1z * d1z
    e = d2x * d2x + d2y * d2y + d2z * d2z
    f = d2x * rx + d2y * ry + d2z * rz
    c = d1x * rx + d1y * ry + d1z * rz
    b = d1x * d2x + d1y * d2y + d1z * d2z
    s, t = 0.0, 0.0
    if a <= 0.0 and e <= 0.0:
        return rx * rx + ry * ry + rz * rz
    if a <= 0.0:
        t = min(max(f / e, 0.0), 1.0)
    elif e <= 0.0:
        s = min(max(-c / a, 0.0), 1.0)
    else:
        denominator = a * e - b * b
        if denominator > 1e-14 * a * e:
            s = min(max((b * f - c * e) / denominator, 0.0), 1.0)
        t = (b * s + f) / e
        if t < 0.0:
            t = 0.0
            s = min(max(-c / a, 0.0), 1.0)
        elif t > 1.0:
            t = 1.0
            s = min(max((b - c) / a, 0.0), 1.0)
    x = rx + s * d1x - t * d2x
    y = ry + s * d1y - t * d2y
    z = rz + s * d1z - t * d2z
    return x * x + y * y + z * z


@numba.njit(cache=True)
def _inside_prism(p, tri, n):
    """Return whether `p` projects into the triangle `tri` with (unnormalised) normal `n`."""
    for k in range(3):
        o, w = tri[k], tri[(k + 1) % 3]
        ex, ey, ez = w[0] - o[0], w[1] - o[1], w[2] - o[2]
        px, py, pz = p[0] - o[0], p[1] - o[1], p[2] - o[2]
        side = n[0] * (ey * pz - ez * py) + n[1] * (ez * px - ex * pz) + n[2] * (ex * py - ey * px)
        if side < 0.0:
            return False
    return True


@numba.njit(cache=True)
def _normal(tri, out):
    ax, ay, az = tri[1, 0] - tri[0, 0], tri[1, 1] - tri[0, 1], tri[1, 2] - tri[0, 2]
    bx, by, bz = tri[2, 0] - tri[0, 0], tri[2, 1] - tri[0, 1], tri[2, 2] - tri[0, 2]
    out[0] = ay * bz - az * by
    out[1] = az * bx - ax * bz
    out[2] = ax * by - ay * bx
    return (out[0] * out[0] + out[1] * out[1] + out[2] * out[2]) ** 0.5


@numba.njit(cache=True)
def _plane_sides(n, length, origin, tri, out):
    """Write the signed distances of the corners of `tri` to a plane into `out`."""
    for k in range(3):
        out[k] = (
            n[0] * (tri[k, 0] - origin[0]) + n[1] * (tri[k, 1] - origin[1]) + n[2] * (tri[k, 2] - origin[2])
        ) / length


@numba.njit(cache=True)
def _pierces(tri, sides, other, n):
    """Return whether an edge of `tri` passes through the interior of `other` (normal n); `sides` are its plane
    distances.
    """
    hit = np.empty(3)
    for k in range(3):
        after = (k + 1) % 3
        if (sides[k] <= 0.0 and sides[after] >= 0.0) or (sides[k] >= 0.0 and sides[after] <= 0.0):
            span = sides[k] - sides[after]
            if span == 0.0:
                continue
            t = sides[k] / span
            for axis in range(3):
                hit[axis] = tri[k, axis] + t * (tri[after, axis] - tri[k, axis])
            if _inside_prism(hit, other, n):
                return True
    return False


@numba.njit(cache=True)
def _triangles_within(p, q, tolerance, np_, nq, sp, sq):
    """Return whether two triangles are at most `tolerance` apart or intersect; np_, nq, sp, sq are scratch (3,)."""
    lp = _normal(p, np_)
    lq = _normal(q, nq)
    if lq > 0.0:
        _plane_sides(nq, lq, q[0], p, sp)
        if min(sp[0], sp[1], sp[2]) > tolerance or max(sp[0], sp[1], sp[2]) < -tolerance:
            return False
    if lp > 0.0:
        _plane_sides(np_, lp, p[0], q, sq)
        if min(sq[0], sq[1], sq[2]) > tolerance or max(sq[0], sq[1], sq[2]) < -tolerance:
            return False
    limit = tolerance * tolerance
    if lq > 0.0:
        for k in range(3):
            if abs(sp[k]) <= tolerance and _inside_prism(p[k], q, nq):
                return True
        if _pierces(p, sp, q, nq):
            return True
    if lp > 0.0:
        for k in range(3):
            if abs(sq[k]) <= tolerance and _inside_prism(q[k], p, np_):
                return True
        if _pierces(q, sq, p, np_):
            return True
    for i in range(3):
        for j in range(3):
            if _segment_distance2(p[i], p[(i + 1) % 3], q[j], q[(j + 1) % 3]) <= limit:
                return True
    return False


@numba.njit(cache=True)
def _boxes_apart(a, b, r, ar, t, tolerance):
    """Return whether box `a` and box `b`, moved by rotation `r` (`ar` = |r|) and translation `t`, are surely apart."""
    dx = r[0, 0] * b[0] + r[0, 1] * b[1] + r[0, 2] * b[2] + t[0] - a[0]
    dy = r[1, 0] * b[0] + r[1, 1] * b[1] + r[1, 2] * b[2] + t[1] - a[1]
    dz = r[2, 0] * b[0] + r[2, 1] * b[1] + r[2, 2] * b[2] + t[2] - a[2]
    if abs(dx) > a[3] + ar[0, 0] * b[3] + ar[0, 1] * b[4] + ar[0, 2] * b[5] + tolerance:
        return True
    if abs(dy) > a[4] + ar[1, 0] * b[3] + ar[1, 1] * b[4] + ar[1, 2] * b[5] + tolerance:
        return True
    if abs(dz) > a[5] + ar[2, 0] * b[3] + ar[2, 1] * b[4] + ar[2, 2] * b[5] + tolerance:
        return True
    ex = r[0, 0] * dx + r[1, 0] * dy + r[2, 0] * dz
    if abs(ex) > b[3] + ar[0, 0] * a[3] + ar[1, 0] * a[4] + ar[2, 0] * a[5] + tolerance:
        return True
    ey = r[0, 1] * dx + r[1, 1] * dy + r[2, 1] * dz
    if abs(ey) > b[4] + ar[0, 1] * a[3] + ar[1, 1] * a[4] + ar[2, 1] * a[5] + tolerance:
        return True
    ez = r[0, 2] * dx + r[1, 2] * dy + r[2, 2] * dz
    return abs(ez) > b[5] + ar[0, 2] * a[3] + ar[1, 2] * a[4] + ar[2, 2] * a[5] + tolerance


@numba.njit(cache=True, inline="always")
def _bounds_apart(corners, u, tri, reach):
    """Return whether the bounding boxes of triangle `u` and of `tri` are more than `reach` apart along an axis."""
    for k in range(3):
        low = min(min(corners[u, 0, k], corners[u, 1, k]), corners[u, 2, k])
        if low - max(max(tri[0, k], tri[1, k]), tri[2, k]) > reach:
            return True
        high = max(max(corners[u, 0, k], corners[u, 1, k]), corners[u, 2, k])
        if min(min(tri[0, k], tri[1, k]), tri[2, k]) - high > reach:
            return True
    return False


@numba.njit(cache=True)
def _walk(ca, ba, la, cb, bb, lb, pose, tolerance, most, pairs):
    """Return the number of triangle pairs within tolerance, up to `most`. Their indices go to `pairs` as far as it has
    rows.
    """
    r = np.ascontiguousarray(pose[:3, :3])
    ar = np.abs(r) + 1e-12
    t = pose[:3, 3].copy()
    stack = np.empty((512, 2), dtype=np.int64)
    moved = np.empty((3, 3))
    scratch = np.empty((4, 3))
    # farther than the tolerance by more than rounding errors
    reach = tolerance + 1e-9 * np.abs(ba[0]).sum()
    count = 0
    stack[0, 0] = 0
    stack[0, 1] = 0
    size = 1
    while size > 0:
        size -= 1
        i, j = stack[size, 0], stack[size, 1]
        if _boxes_apart(ba[i], bb[j], r, ar, t, tolerance):
            continue
        leaf_a, leaf_b = la[i, 0] < 0, lb[j, 0] < 0
        if leaf_a and leaf_b:
            for v in range(-lb[j, 0] - 1, -lb[j, 0] - 1 + lb[j, 1]):
                for k in range(3):
                    for axis in range(3):
                        moved[k, axis] = (
                            r[axis, 0] * cb[v, k, 0] + r[axis, 1] * cb[v, k, 1] + r[axis, 2] * cb[v, k, 2] + t[axis]
                        )
                for u in range(-la[i, 0] - 1, -la[i, 0] - 1 + la[i, 1]):
                    if _bounds_apart(ca, u, moved, reach):
                        continue
                    if _triangles_within(ca[u], moved, tolerance, scratch[0], scratch[1], scratch[2], scratch[3]):
                        if count < len(pairs):
                            pairs[count, 0] = u
                            pairs[count, 1] = v
                        count += 1
                        if count >= most:
                            return count
        elif leaf_b or (not leaf_a and ba[i, 3] + ba[i, 4] + ba[i, 5] > bb[j, 3] + bb[j, 4] + bb[j, 5]):
            for child in range(2):
                stack[size, 0], stack[size, 1] = la[i, child], j
                size += 1
        else:
            for child in range(2):
                stack[size, 0], stack[size, 1] = i, lb[j, child]
                size += 1
    return count


_NO_PAIRS = np.empty((0, 2), dtype=np.int64)
_ALL_PAIRS = 2**62


def first_contact(a: Tree, b: Tree, pose: FloatArray, tolerance: float) -> bool:
    """Return whether mesh `b`, moved by `pose` (4, 4) into coordinates of mesh `a`, comes within `tolerance` of it."""
    return bool(_walk(*a, *b, pose, tolerance, 1, _NO_PAIRS))


def first_pairs(a: Tree, b: Tree, pose: FloatArray, tolerance: float, most: int) -> np.ndarray:
    """Return the first pairs of triangles within `tolerance`, at most `most`, int64 (p, 2), as of `near_pairs`."""
    pairs = np.empty((most, 2), dtype=np.int64)
    return pairs[: _walk(*a, *b, pose, tolerance, most, pairs)]


def near_pairs(a: Tree, b: Tree, pose: FloatArray, tolerance: float) -> np.ndarray:
    """Return all pairs of triangles within `tolerance`, int64 (p, 2), in tree order of `a` and `b`."""
    # a surface and itself: each triangle and the dozen around it; only what is written takes memory
    pairs = np.empty((max(4096, 16 * min(len(a[0]), len(b[0]))), 2), dtype=np.int64)
    count = _walk(*a, *b, pose, tolerance, _ALL_PAIRS, pairs)
    if count > len(pairs):
        pairs = np.empty((count, 2), dtype=np.int64)
        _walk(*a, *b, pose, tolerance, _ALL_PAIRS, pairs)
    return pairs[:count]


@numba.njit(cache=True)
def contact_patches(ca, cb, pairs, pose, tolerance):
    """Find where mesh `b` touches mesh `a`: for each pair of near triangles the share of the first near the second.

    Returns, in coordinates of `a`:
    points: corners of the shares, float64 (q, 3)
    area: area of each share if the two triangles are parallel within 8 degrees, else 0, float64 (p,)
    crossing: whether each triangle reaches more than twice the tolerance to both sides of the other's plane, bool (p,)
    """
    r, t = pose[:3, :3], pose[:3, 3]
    points = np.empty((12 * len(pairs) + 1, 3))
    area = np.zeros(len(pairs))
    crossing = np.zeros(len(pairs), dtype=np.bool_)
    total = 0
    polygon = np.empty((16, 3))
    spare = np.empty((16, 3))
    tri = np.empty((3, 3))
    na, nb, edge, sides = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for index in range(len(pairs)):
        first = ca[pairs[index, 0]]
        for k in range(3):
            for axis in range(3):
                c = cb[pairs[index, 1], k]
                tri[k, axis] = r[axis, 0] * c[0] + r[axis, 1] * c[1] + r[axis, 2] * c[2] + t[axis]
        la, lb = _normal(first, na), _normal(tri, nb)
        if la <= 0.0 or lb <= 0.0:
            continue
        for axis in range(3):
            na[axis] /= la
            nb[axis] /= lb
        _plane_sides(nb, 1.0, tri[0], first, sides)
        cross_a = sides.min() < -2 * tolerance and sides.max() > 2 * tolerance
        _plane_sides(na, 1.0, first[0], tri, sides)
        cross_b = sides.min() < -2 * tolerance and sides.max() > 2 * tolerance
        crossing[index] = cross_a and cross_b
        for k in range(3):
            polygon[k] = first[k]
        base = _dot(nb, tri[0])
        count = cut_polygon(polygon, 3, nb, 1.0, base + tolerance, spare)
        for axis in range(3):
            nb[axis] = -nb[axis]
        count = cut_polygon(spare, count, nb, 1.0, -base + tolerance, polygon)
        for k in range(3):
            if count == 0:
                break
            after = (k + 1) % 3
            ex, ey, ez = tri[after, 0] - tri[k, 0], tri[after, 1] - tri[k, 1], tri[after, 2] - tri[k, 2]
            # nb points backwards here, so edge x nb points out of the triangle with its sign turned
            edge[0] = ez * nb[1] - ey * nb[2]
            edge[1] = ex * nb[2] - ez * nb[0]
            edge[2] = ey * nb[0] - ex * nb[1]
            length = (edge[0] * edge[0] + edge[1] * edge[1] + edge[2] * edge[2]) ** 0.5
            if length == 0.0:
                continue
            for axis in range(3):
                edge[axis] /= length
            count = cut_polygon(polygon, count, edge, 1.0, _dot(edge, tri[k]) + tolerance, spare)
            polygon, spare = spare, polygon
        if count == 0:
            continue
        if abs(_dot(na, nb)) > 0.99:
            area[index] = polygon_area(polygon, count)
        for k in range(count):
            points[total] = polygon[k]
            total += 1
    return points[:total], area, crossing


@numba.njit(cache=True)
def _point_triangle_distance2(p, tri, n):
    """Return the squared distance of a point and a triangle; n is scratch (3,)."""
    length = _normal(tri, n)
    if length > 0.0 and _inside_prism(p, tri, n):
        h = (n[0] * (p[0] - tri[0, 0]) + n[1] * (p[1] - tri[0, 1]) + n[2] * (p[2] - tri[0, 2])) / length
        return h * h
    best = np.inf
    for k in range(3):
        best = min(best, _segment_distance2(p, p, tri[k], tri[(k + 1) % 3]))
    return best


@numba.njit(cache=True)
def points_on_surface(corners, boxes, links, points, tolerance):
    """Return whether all of `points` (q, 3) lie within `tolerance` of the mesh."""
    stack = np.empty(512, dtype=np.int64)
    n = np.empty(3)
    for index in range(len(points)):
        p = points[index]
        stack[0] = 0
        size, near = 1, False
        while size > 0 and not near:
            size -= 1
            node = stack[size]
            box = boxes[node]
            if (
                abs(p[0] - box[0]) > box[3] + tolerance
                or abs(p[1] - box[1]) > box[4] + tolerance
                or abs(p[2] - box[2]) > box[5] + tolerance
            ):
                continue
            if links[node, 0] < 0:
                first = -links[node, 0] - 1
                for u in range(first, first + links[node, 1]):
                    if _point_triangle_distance2(p, corners[u], n) <= tolerance * tolerance:
                        near = True
                        break
            else:
                stack[size], stack[size + 1] = links[node, 0], links[node, 1]
                size += 2
        if not near:
            return False
    return True


@numba.njit(cache=True)
def _box_distance2(p, box):
    """Return the squared distance of a point and a box."""
    total = 0.0
    for k in range(3):
        gap = max(abs(p[k] - box[k]) - box[3 + k], 0.0)
        total += gap * gap
    return total


@numba.njit(cache=True)
def distances_to_surface(corners, boxes, links, points):
    """Return the distance of each of `points` (q, 3) to the mesh, float64 (q,)."""
    distances = np.empty(len(points))
    stack = np.empty(512, dtype=np.int64)
    n = np.empty(3)
    for index in range(len(points)):
        p = points[index]
        best = np.inf
        stack[0] = 0
        size = 1
        while size > 0:
            size -= 1
            node = stack[size]
            if _box_distance2(p, boxes[node]) >= best:
                continue
            if links[node, 0] < 0:
                first = -links[node, 0] - 1
                for u in range(first, first + links[node, 1]):
                    tri = corners[u]
                    # the normal of a sliver says nothing, and its edges are all of it
                    longest = 0.0
                    for k in range(3):
                        best = min(best, _segment_distance2(p, p, tri[k], tri[(k + 1) % 3]))
                        for axis in range(3):
                            longest = max(longest, abs(tri[k, axis] - tri[(k + 1) % 3, axis]))
                    length = _normal(tri, n)
                    if length > SLIVER_SHARE * longest * longest and _inside_prism(p, tri, n):
                        h = n[0] * (p[0] - tri[0, 0]) + n[1] * (p[1] - tri[0, 1]) + n[2] * (p[2] - tri[0, 2])
                        best = min(best, h * h / (length * length))
            else:
                near, far = links[node, 0], links[node, 1]
                if _box_distance2(p, boxes[near]) > _box_distance2(p, boxes[far]):
                    near, far = far, near
                stack[size], stack[size + 1] = far, near
                size += 2
        distances[index] = np.sqrt(best)
    return distances
