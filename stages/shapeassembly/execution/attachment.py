"""The compiled effect of one attachment on a cuboid (shapeassembly App. A).

A cuboid is a row of 15 numbers: centre, sizes, and its x, y and z axes as unit vectors. Where the appendix and the
authors' code differ, this follows the code, with which the published programs were made. Each rule records its decision
for the differentiable interpreter.
"""

from __future__ import annotations

import numba
import numpy as np

MOVE, STAY, GROW, HINGE, SWING = range(5)
"""The rule of an attachment: the first of its cuboid; an aligned cuboid that is near enough; one that grew; the second
attachment; a later one.
"""

ADD_ALL, SCALE_ALL = 3, 4
"""In place of an axis: all sizes changed by one amount, or by one factor."""

_GRID_POINTS = 10
_NEAR_SHARE = 0.05  # smaller gaps count as none, as a share of the largest size of both cuboids
_FACING_COSINE = 0.9  # minimum cosine between a face's normal and the direction to the goal for the face to move
_MAX_PRIOR_SHIFT = 0.01  # maximum shift of prior attachments
_MIN_LENGTH = 1e-9


@numba.njit(cache=True)
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@numba.njit(cache=True)
def _norm(a):
    return np.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])


@numba.njit(cache=True)
def _cross(a, b, out):
    out[0], out[1], out[2] = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@numba.njit(cache=True)
def point(box, p, out):
    """Write the point of a cuboid with local coordinates `p`."""
    a, b, c = (p[0] - 0.5) * box[3], (p[1] - 0.5) * box[4], (p[2] - 0.5) * box[5]
    for k in range(3):
        out[k] = box[k] + a * box[6 + k] + b * box[9 + k] + c * box[12 + k]


@numba.njit(cache=True)
def local(box, point, out):
    """Write the local coordinates of a point."""
    x, y, z = point[0] - box[0], point[1] - box[1], point[2] - box[2]
    for k in range(3):
        along = x * box[6 + 3 * k] + y * box[7 + 3 * k] + z * box[8 + 3 * k]
        out[k] = along / box[3 + k] + 0.5


@numba.njit(cache=True)
def _has_corner(box, other):
    """Return whether a corner of `other` is in `box`."""
    p, q, g = np.empty(3), np.empty(3), np.empty(3)
    for corner in range(8):
        p[0], p[1], p[2] = corner >> 2, (corner >> 1) & 1, corner & 1
        point(other, p, g)
        local(box, g, q)
        if min(q[0], q[1], q[2]) >= -_MIN_LENGTH and max(q[0], q[1], q[2]) <= 1.0 + _MIN_LENGTH:
            return True
    return False


@numba.njit(cache=True)
def _nearest_straight(box, target, near, far, gap):
    """Find the nearest grid points of two upright cuboids, axis by axis."""
    for k in range(3):
        low, other = box[k] - box[3 + k] / 2, target[k] - target[3 + k] / 2
        best = np.inf
        for i in range(_GRID_POINTS):
            own = low + box[3 + k] * i / (_GRID_POINTS - 1)
            for j in range(_GRID_POINTS):
                way = other + target[3 + k] * j / (_GRID_POINTS - 1) - own
                if abs(way) < best - _MIN_LENGTH:
                    best, near[k], far[k], gap[k] = abs(way), i / (_GRID_POINTS - 1), j / (_GRID_POINTS - 1), way


@numba.njit(cache=True)
def _nearest_tilted(box, target, near, far, gap):
    """Find the nearest grid points of an upright `box` and any target, whose point is found by rounding."""
    p, g, q, h = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    best = np.finfo(np.float64).max
    for i in range(_GRID_POINTS**3):
        p[0], p[1], p[2] = i // _GRID_POINTS**2, i // _GRID_POINTS % _GRID_POINTS, i % _GRID_POINTS
        p /= _GRID_POINTS - 1
        point(box, p, g)
        local(target, g, q)
        for k in range(3):
            q[k] = min(max(np.ceil(q[k] * (_GRID_POINTS - 1) - 0.5 - _MIN_LENGTH), 0.0), _GRID_POINTS - 1.0) / (
                _GRID_POINTS - 1
            )
        point(target, q, h)
        h -= g
        distance = _dot(h, h)
        if distance < best * (1 - 1e-12) - _MIN_LENGTH * _MIN_LENGTH:
            best = distance
            near[:] = p
            far[:] = q
            gap[:] = h


@numba.njit(cache=True)
def grow_to_target(box, target, decision):
    """Attach an aligned cuboid again, whatever its points: grow towards `target` if it is away."""
    decision[0] = STAY
    if _has_corner(target, box) or _has_corner(box, target):
        return
    near, far, gap = decision[2:5], decision[5:8], np.empty(3)
    if abs(target[6] - 1.0) + abs(target[10] - 1.0) + abs(target[14] - 1.0) < 1e-12:
        _nearest_straight(box, target, near, far, gap)
    else:
        _nearest_tilted(box, target, near, far, gap)
    largest = max(max(box[3], box[4], box[5]), max(target[3], target[4], target[5]))
    if _norm(gap) < _NEAR_SHARE * largest:
        return
    decision[0] = GROW
    for k in range(3):
        # The point opposite `near` stays fixed.
        more = gap[k] / (2 * near[k] - 1)
        if more > 0:
            box[3 + k] += more
            box[k] += more * (near[k] - 0.5)


@numba.njit(cache=True)
def _rotate_about(box, pivot, u, cosine, sine):
    """Rotate a cuboid about the axis through `pivot` along the unit vector `u`."""
    for start in range(0, 15, 3):
        if start == 3:
            continue
        x, y, z = box[start], box[start + 1], box[start + 2]
        if start == 0:
            x, y, z = x - pivot[0], y - pivot[1], z - pivot[2]
        along = (u[0] * x + u[1] * y + u[2] * z) * (1 - cosine)
        box[start] = x * cosine + (u[1] * z - u[2] * y) * sine + u[0] * along
        box[start + 1] = y * cosine + (u[2] * x - u[0] * z) * sine + u[1] * along
        box[start + 2] = z * cosine + (u[0] * y - u[1] * x) * sine + u[2] * along
    for k in range(3):
        box[k] += pivot[k]


@numba.njit(cache=True)
def _rotate_onto(box, pivot, source, goal):
    """Rotate a cuboid about `pivot` by the smallest angle, so that `source` points towards `goal`.

    Returns whether it was half a turn, whose axis is `across` of the arm.
    """
    a, b, u = source - pivot, goal - pivot, np.empty(3)
    _cross(a, b, u)
    lengths = _norm(a) * _norm(b)
    sine, cosine = _norm(u) / lengths, _dot(a, b) / lengths
    if sine >= _MIN_LENGTH:
        u /= sine * lengths
        _rotate_about(box, pivot, u, cosine, sine)
        return False
    if cosine > 0:
        return False
    across(a, u)
    _rotate_about(box, pivot, u, -1.0, 0.0)
    return True


@numba.njit(cache=True)
def across(a, u):
    """Write a unit vector perpendicular to `a` and to the coordinate axis that is least parallel to it."""
    k = 0
    for j in range(1, 3):
        if abs(a[j]) < abs(a[k]):
            k = j
    i, j = (k + 1) % 3, (k + 2) % 3
    length = np.sqrt(a[i] ** 2 + a[j] ** 2)
    u[k], u[i], u[j] = 0.0, a[j] / length, -a[i] / length


@numba.njit(cache=True)
def hinge(box, prior, p, goal, decision):
    """Attach a second time: change one size, or all if none suffices, to the right distance; then turn the cuboid."""
    decision[0], decision[1] = HINGE, -1
    pivot, source = np.empty(3), np.empty(3)
    point(box, prior, pivot)
    way, arm = goal - pivot, (p - prior) * box[3:6]
    wanted, has = _dot(way, way), _dot(arm, arm)
    if wanted < _MIN_LENGTH * _MIN_LENGTH or has < _MIN_LENGTH * _MIN_LENGTH:
        return
    best = np.inf
    for k in range(3):
        if abs(arm[k]) < _MIN_LENGTH:
            continue
        square = 1 + (wanted - has) / arm[k] ** 2
        if square > 1e-12 and abs(np.sqrt(square) - 1) * box[3 + k] < best - _MIN_LENGTH:
            best = abs(np.sqrt(square) - 1) * box[3 + k]
            decision[1] = k
    if decision[1] < 0:
        _change_all(box, p - prior, wanted, has, decision)
    else:
        k = int(decision[1])
        box[3 + k] *= np.sqrt(1 + (wanted - has) / arm[k] ** 2)
    hold(box, prior, pivot)
    point(box, p, source)
    decision[2] = _rotate_onto(box, pivot, source, goal)


@numba.njit(cache=True)
def _change_all(box, reach, wanted, has, decision):
    """Change the squared length of the arm from `has` to `wanted` by adding one amount to each size.

    Where no amount leaves a box, they are scaled by a common factor.
    """
    square, linear = _dot(reach, reach), _dot(reach * reach, box[3:6])
    under = linear * linear - square * (has - wanted)
    amount = (np.sqrt(max(under, 0.0)) - linear) / square
    if under >= 0 and min(box[3], box[4], box[5]) + amount > _MIN_LENGTH:
        decision[1] = ADD_ALL
        box[3:6] += amount
    else:
        decision[1] = SCALE_ALL
        box[3:6] *= np.sqrt(wanted / has)


@numba.njit(cache=True)
def hold(box, p, position):
    """Move a cuboid so that its point `p` is at `position`."""
    now = np.empty(3)
    point(box, p, now)
    for k in range(3):
        box[k] += position[k] - now[k]


@numba.njit(cache=True)
def _face_of(p):
    """Return axis and side, 1 or -1, of the face that is nearest to a local point."""
    axis, side, best = 0, 1.0, np.inf
    for k in range(3):
        if abs(1 - p[k]) < best:
            best, axis, side = abs(1 - p[k]), k, 1.0
        if abs(p[k]) < best:
            best, axis, side = abs(p[k]), k, -1.0
    return axis, side


@numba.njit(cache=True)
def swing(box, priors, p, goal, decision):
    """Attach after two or more attachments: turn about their line, if they have one, then move the face nearer."""
    decision[0], decision[1], decision[2] = SWING, -1, 0
    pivot, other, source, u, normal = np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    point(box, priors[0], pivot)
    point(box, priors[1], u)
    u -= pivot
    straight = True
    for n in range(2, len(priors)):
        point(box, priors[n], other)
        other -= pivot
        x, y, z = (
            u[1] * other[2] - u[2] * other[1],
            u[2] * other[0] - u[0] * other[2],
            u[0] * other[1] - u[1] * other[0],
        )
        straight = straight and x * x + y * y + z * z < _MAX_PRIOR_SHIFT * _MAX_PRIOR_SHIFT
    length = _norm(u)
    if straight and length > _MIN_LENGTH:
        u /= length
        point(box, p, source)
        s, t = source - pivot, goal - pivot
        s -= u * _dot(u, s)
        t -= u * _dot(u, t)
        lengths = _norm(s) * _norm(t)
        if lengths > _MIN_LENGTH:
            _cross(s, t, normal)
            _rotate_about(box, pivot, u, _dot(s, t) / lengths, _dot(u, normal) / lengths)
            decision[2] = 1
    point(box, p, source)
    _push(box, priors, p, goal - source, decision)


@numba.njit(cache=True)
def _push(box, priors, p, way, decision):
    """Move the face of point `p` along `way` if it faces there and no prior attachment shifts too far."""
    axis, side = _face_of(p)
    along, distance = side * _dot(way, box[6 + 3 * axis : 9 + 3 * axis]), _norm(way)
    apart = side * (p[axis] - priors[0][axis])
    if distance < _MIN_LENGTH or along <= _FACING_COSINE * distance or apart < 1e-6:
        return
    more = along / apart
    for n in range(1, len(priors)):
        if abs(priors[n][axis] - priors[0][axis]) * more > _MAX_PRIOR_SHIFT:
            return
    decision[1] = axis
    position = np.empty(3)
    point(box, priors[0], position)
    box[3 + axis] += more
    hold(box, priors[0], position)
