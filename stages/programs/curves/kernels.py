"""Compiled loops over curves and rings of few points, where array calls would be mostly overhead."""

from __future__ import annotations

import numba
import numpy as np


@numba.njit(cache=True)
def measure(points, closed):
    """Directions (m, 3), lengths (m,), and the cosine of the turn before each segment but an open curve's first."""
    count = len(points)
    segments = count if closed else count - 1
    directions, lengths, turns = np.empty((segments, 3)), np.empty(segments), np.ones(segments)
    for i in range(segments):
        j = (i + 1) % count
        x, y, z = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1], points[j, 2] - points[i, 2]
        length = np.sqrt(x * x + y * y + z * z)
        lengths[i] = length
        if length > 0.0:
            directions[i, 0], directions[i, 1], directions[i, 2] = x / length, y / length, z / length
        else:
            directions[i] = 0.0
    for i in range(0 if closed else 1, segments):
        a, b = directions[i - 1], directions[i]
        turns[i] = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    return directions, lengths, turns


@numba.njit(cache=True)
def halve_turns(directions, turns, closed, sharpest):
    """Tangents (n, 3) that halve the turns, the directions across them in which a mitre reaches (n, 3), and by how
    much more than 1, at most `sharpest` - 1 (n,)."""
    segments = len(directions)
    count = segments if closed else segments + 1
    tangents, fold, excess = np.empty((count, 3)), np.zeros((count, 3)), np.zeros(count)
    for i in range(count):
        if not closed and (i == 0 or i == segments):
            tangents[i] = directions[min(i, segments - 1)]
            continue
        a, b = directions[i - 1], directions[i]
        middle, across = np.sqrt(2.0 + 2.0 * turns[i]), np.sqrt(max(2.0 - 2.0 * turns[i], 0.0))
        for k in range(3):
            tangents[i, k] = (a[k] + b[k]) / middle
        if across > 1e-7:
            for k in range(3):
                fold[i, k] = (b[k] - a[k]) / across
            excess[i] = min(2.0 / middle, sharpest) - 1.0
    return tangents, fold, excess


@numba.njit(cache=True)
def ease(points, girth, max_rounds, local_rounds):
    """Move points (n, 3) next to tight bends towards their neighbours, until every mitre of a profile of radius `girth`
    (n,) fits into its segments. After `local_rounds` all points are moved."""
    count = len(points)
    moved, before = points.copy(), np.empty_like(points)
    lengths, mitres, near = np.empty(count - 1), np.zeros(count), np.zeros(count, dtype=np.bool_)
    for turn in range(max_rounds):
        before[:] = moved
        for i in range(count - 1):
            total = 0.0
            for k in range(3):
                total += (before[i + 1, k] - before[i, k]) ** 2
            lengths[i] = np.sqrt(total)
        for i in range(1, count - 1):
            cosine = 0.0
            for k in range(3):
                cosine += (before[i + 1, k] - before[i, k]) * (before[i, k] - before[i - 1, k])
            cosine /= lengths[i] * lengths[i - 1]
            # A mitre takes the tangent of half the turn from the segments on both sides.
            mitres[i] = girth[i] * np.sqrt(max(1.0 - cosine, 0.0) / max(1.0 + cosine, 1e-6))
        near[:] = False
        for i in range(count - 1):
            if mitres[i] + mitres[i + 1] > 0.9 * lengths[i]:
                near[max(i - 1, 0) : i + 3] = True
        if not near.any():
            break
        for i in range(1, count - 1):
            if near[i] or turn >= local_rounds:
                for k in range(3):
                    moved[i, k] += 0.45 * (before[i + 1, k] + before[i - 1, k] - 2.0 * before[i, k])
    return moved


@numba.njit(cache=True)
def carry(points, tangents, positions, first, closed):
    """The axes x and y (n, 3) at each point: `first`, carried along by double reflection (Wang et al. 2008).

    On a closed curve, the angle left after a round is spread over its length.
    """
    count = len(points)
    x, y = np.empty((count, 3)), np.empty((count, 3))
    x[0] = first
    carried = np.empty(3)
    for i in range(1, count + 1 if closed else count):
        j = i % count
        a, t, u = x[i - 1], tangents[i - 1], tangents[j]
        s0, s1, s2 = points[j, 0] - points[i - 1, 0], points[j, 1] - points[i - 1, 1], points[j, 2] - points[i - 1, 2]
        twice = 2.0 / (s0 * s0 + s1 * s1 + s2 * s2)
        p = twice * (s0 * a[0] + s1 * a[1] + s2 * a[2])
        q = twice * (s0 * t[0] + s1 * t[1] + s2 * t[2])
        a0, a1, a2 = a[0] - p * s0, a[1] - p * s1, a[2] - p * s2
        m0, m1, m2 = u[0] - t[0] + q * s0, u[1] - t[1] + q * s1, u[2] - t[2] + q * s2
        r = 2.0 * (m0 * a0 + m1 * a1 + m2 * a2) / (m0 * m0 + m1 * m1 + m2 * m2)
        a0, a1, a2 = a0 - r * m0, a1 - r * m1, a2 - r * m2
        # Rounding errors add up along a long curve: make it perpendicular and of unit length again.
        out = a0 * u[0] + a1 * u[1] + a2 * u[2]
        a0, a1, a2 = a0 - out * u[0], a1 - out * u[1], a2 - out * u[2]
        size = np.sqrt(a0 * a0 + a1 * a1 + a2 * a2)
        carried[0], carried[1], carried[2] = a0 / size, a1 / size, a2 / size
        if i < count:
            x[i] = carried
    for i in range(count):
        y[i] = np.cross(tangents[i], x[i])
    if closed:
        left = np.arctan2(np.dot(carried, y[0]), np.dot(carried, x[0]))
        for i in range(count):
            cosine, sine = np.cos(left * positions[i]), np.sin(left * positions[i])
            for k in range(3):
                a0, a1 = x[i, k], y[i, k]
                x[i, k], y[i, k] = cosine * a0 - sine * a1, cosine * a1 + sine * a0
    return x, y


@numba.njit(cache=True)
def place_rings(points, x, y, scale, twist, fold, excess, outlines):
    """The rings (n, k, 3) of outlines (n or 1, k, 2), scaled (n, 2), turned (n,) degrees, stretched along folds."""
    count, around = len(points), outlines.shape[1]
    rings = np.empty((count, around, 3))
    p, q = np.empty(3), np.empty(3)
    for i in range(count):
        outline = outlines[i % len(outlines)]
        angle = np.radians(twist[i])
        cosine, sine = np.cos(angle), np.sin(angle)
        reach_p, reach_q = 0.0, 0.0
        for k in range(3):
            p[k] = scale[i, 0] * (cosine * x[i, k] + sine * y[i, k])
            q[k] = scale[i, 1] * (cosine * y[i, k] - sine * x[i, k])
            reach_p += p[k] * fold[i, k]
            reach_q += q[k] * fold[i, k]
        for k in range(3):
            p[k] += excess[i] * reach_p * fold[i, k]
            q[k] += excess[i] * reach_q * fold[i, k]
        for j in range(around):
            for k in range(3):
                rings[i, j, k] = points[i, k] + outline[j, 0] * p[k] + outline[j, 1] * q[k]
    return rings


@numba.njit(cache=True)
def all_seen(points):
    """Whether every side of a polygon (k, 2) is visible from the mean of its points, and whether it is convex."""
    count = len(points)
    mx, my = points[:, 0].mean(), points[:, 1].mean()
    size = 0.0
    for i in range(count):
        size += ((points[i, 0] - mx) ** 2 + (points[i, 1] - my) ** 2) / count
    seen, convex = True, True
    for i in range(count):
        ax, ay = points[i, 0] - mx, points[i, 1] - my
        bx, by = points[(i + 1) % count, 0] - mx, points[(i + 1) % count, 1] - my
        cx, cy = points[(i + 2) % count, 0] - mx, points[(i + 2) % count, 1] - my
        seen = seen and ax * by - ay * bx > 1e-9 * size
        convex = convex and (bx - ax) * (cy - by) - (by - ay) * (cx - bx) >= -1e-9 * size
    return seen, convex


@numba.njit(cache=True)
def _facing(a, b, c, x, y, z):
    """Area of a triangle (times 2) as seen along (x, y, z) (times its length); negative from behind."""
    d0, d1, d2 = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    e0, e1, e2 = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    return (d1 * e2 - d2 * e1) * x + (d2 * e0 - d0 * e2) * y + (d0 * e1 - d1 * e0) * z


@numba.njit(cache=True)
def cut_quads(vertices, quads):
    """Triangles, int32 (f, 3): each quad is cut along the diagonal with the larger smaller piece, seen from its front.

    A quad with a notch is cut there.
    """
    triangles = np.empty((2 * len(quads), 3), dtype=np.int32)
    count = 0
    for i in range(len(quads)):
        i0, i1, i2, i3 = quads[i, 0], quads[i, 1], quads[i, 2], quads[i, 3]
        if i2 == i3:
            triangles[count, 0], triangles[count, 1], triangles[count, 2] = i0, i1, i2
            count += 1
            continue
        a, b, c, d = vertices[i0], vertices[i1], vertices[i2], vertices[i3]
        e0, e1, e2 = c[0] - a[0], c[1] - a[1], c[2] - a[2]
        f0, f1, f2 = d[0] - b[0], d[1] - b[1], d[2] - b[2]
        x, y, z = e1 * f2 - e2 * f1, e2 * f0 - e0 * f2, e0 * f1 - e1 * f0
        first = min(_facing(a, b, c, x, y, z), _facing(a, c, d, x, y, z))
        other = min(_facing(a, b, d, x, y, z), _facing(b, c, d, x, y, z))
        # Equal halves are cut along 0-2 despite rounding, so that a moved mesh has the same triangles.
        if other > first + 1e-6 * abs(first):
            i0, i1, i2, i3 = i1, i2, i3, i0
        triangles[count, 0], triangles[count, 1], triangles[count, 2] = i0, i1, i2
        triangles[count + 1, 0], triangles[count + 1, 1], triangles[count + 1, 2] = i0, i2, i3
        count += 2
    return triangles[:count]
