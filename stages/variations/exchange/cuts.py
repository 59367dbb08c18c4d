"""Cutting a connected piece out of a shape (strings §4, subgraph sampling)."""

from __future__ import annotations

import numba
import numpy as np

from stages.variations.kernels.operators import GROWN_CUT, JOINT_CUT
from stages.variations.kernels.outcomes import Outcome
from stages.variations.kernels.random_choice import random_below
from stages.variations.kernels.structs import N_BOUNDARY, N_PIECE_PARTS

PART_AXES_PROBABILITY = 0.75
"""Probability that planes are along the axes of a part; otherwise they have any direction."""
IN_HALF_SPACE, IN_BOX = 0, 2
"""What planes bound; 1 is a slab."""


@numba.njit(cache=True)
def cut_connected_piece(rng, a, b, ws, operator, slack):
    """Cut a random connected piece out of A into `ws.inside`, and its boundary into `ws.boundary`.

    The boundary are the parts with a neighbour outside, that of the rarest type in B first.
    slack: how far behind a plane a part may be that is in it
    """
    size = _cut(rng, a, b, ws, operator, slack)
    count = put_boundary(a, ws)
    ws.counts[N_PIECE_PARTS] = size
    if count == 0 or size == len(a.types):
        return Outcome.WHOLE
    rarest, smallest = 0, 1 << 30
    for k in range(count):
        part_type = a.types[ws.boundary[k]]
        present = b.type_starts[part_type + 1] - b.type_starts[part_type]
        if present == 0:
            return Outcome.NO_SUCH_PART
        if present < smallest:
            rarest, smallest = k, present
    first = ws.boundary[0]
    ws.boundary[0] = ws.boundary[rarest]
    ws.boundary[rarest] = first
    return Outcome.OK


@numba.njit(cache=True)
def put_boundary(a, ws):
    """Write the parts of the piece with a neighbour outside into `ws.boundary`; return their number, also in the
    counts.
    """
    count = 0
    for part in range(len(a.types)):
        if ws.inside[part]:
            for e in range(a.starts[part], a.starts[part + 1]):
                if not ws.inside[a.ends[e]]:
                    ws.boundary[count] = part
                    count += 1
                    break
    ws.counts[N_BOUNDARY] = count
    return count


@numba.njit(cache=True)
def _cut(rng, shape, other, ws, operator, slack):
    """Cut a random connected piece out of a shape into `ws.inside`; return its number of parts.

    operator: GROWN_CUT, JOINT_CUT or PLANE_CUT
    """
    ws.inside[: len(shape.types)] = False
    seed = random_below(rng, len(shape.types))
    if operator == JOINT_CUT:
        return _cut_at_joints(rng, shape, other.type_starts, ws.inside, ws.stack, seed)
    if operator == GROWN_CUT:
        return _grow(rng, shape.starts, shape.ends, ws.inside, ws.stack, seed)
    return _cut_by_planes(rng, shape, ws.inside, ws.component, ws.stack, seed, slack)


@numba.njit(cache=True)
def _grow(rng, starts, ends, inside, stack, seed):
    """Grow a piece of a random number of parts from `seed`, a random adjacent part at a time."""
    n = len(starts) - 1
    wanted = 1 + random_below(rng, n - 1)
    size, count = 0, 1
    stack[0] = seed
    while count > 0 and size < wanted:
        pick = random_below(rng, count)
        part = stack[pick]
        count -= 1
        stack[pick] = stack[count]
        if inside[part]:
            continue
        inside[part] = True
        size += 1
        for e in range(starts[part], starts[part + 1]):
            if not inside[ends[e]] and count < len(stack):
                stack[count] = ends[e]
                count += 1
    return size


@numba.njit(cache=True)
def _cut_at_joints(rng, shape, other_starts, inside, stack, seed):
    """Cut a piece that ends at parts of one or two types which the other shape has too, by its `other_starts` of types.

    In half of all cuts some of these are passed.
    """
    n = len(shape.types)
    joints = np.empty(2, dtype=np.int64)
    for k in range(2):
        joints[k] = -1
        for _ in range(8):
            part_type = shape.types[random_below(rng, n)]
            if other_starts[part_type + 1] > other_starts[part_type]:
                joints[k] = part_type
                break
    if rng.random() < 0.5:
        joints[1] = -1
    leaky = 0.4 * rng.random() if rng.random() < 0.5 else 0.0
    stack[0] = seed
    inside[seed] = True
    size, count = 0, 1
    while count > 0:
        count -= 1
        part = stack[count]
        size += 1
        part_type = shape.types[part]
        if part != seed and (part_type == joints[0] or part_type == joints[1]) and rng.random() >= leaky:
            continue
        for e in range(shape.starts[part], shape.starts[part + 1]):
            end = shape.ends[e]
            if not inside[end]:
                inside[end] = True
                stack[count] = end
                count += 1
    return size


@numba.njit(cache=True)
def _cut_by_planes(rng, shape, inside, within, stack, seed, slack):
    """Cut what a half-space, a slab or a box holds, as far as it is connected to `seed`; `within` and `stack` are
    scratch.
    """
    n = len(shape.types)
    axes = np.empty((3, 3))
    if rng.random() < PART_AXES_PROBABILITY:
        axes[:] = shape.rotations[random_below(rng, n)].T
    else:
        _draw_axes(rng, axes)
    kind = random_below(rng, 3)
    used = 3 if kind == IN_BOX else 1
    first = random_below(rng, 3)
    low, high = np.empty(3), np.empty(3)
    far = random_below(rng, n)
    for u in range(used):
        axis = axes[(first + u) % 3]
        a, b = _along(axis, shape.translations[seed]), _along(axis, shape.translations[far])
        if kind == IN_HALF_SPACE:
            if rng.random() < 0.5:
                low[u], high[u] = a - slack, np.inf
            else:
                low[u], high[u] = -np.inf, a + slack
        else:
            low[u], high[u] = min(a, b) - slack, max(a, b) + slack
    for part in range(n):
        within[part] = 1
        for u in range(used):
            x = _along(axes[(first + u) % 3], shape.translations[part])
            if x < low[u] or x > high[u]:
                within[part] = 0
                break
    return connected(shape.starts, shape.ends, within, inside, stack, seed)


@numba.njit(cache=True)
def _along(axis, point):
    """Return a point's coordinate along an axis."""
    return axis[0] * point[0] + axis[1] * point[1] + axis[2] * point[2]


@numba.njit(cache=True)
def _draw_axes(rng, axes):
    """Draw three random perpendicular axes, as rows."""
    for i in range(2):
        norm = 0.0
        while norm < 1e-3:
            for j in range(3):
                axes[i, j] = 2.0 * rng.random() - 1.0
            if i == 1:
                along = _along(axes[1], axes[0])
                for j in range(3):
                    axes[1, j] -= along * axes[0, j]
            norm = (axes[i, 0] ** 2 + axes[i, 1] ** 2 + axes[i, 2] ** 2) ** 0.5
        for j in range(3):
            axes[i, j] /= norm
    axes[2, 0] = axes[0, 1] * axes[1, 2] - axes[0, 2] * axes[1, 1]
    axes[2, 1] = axes[0, 2] * axes[1, 0] - axes[0, 0] * axes[1, 2]
    axes[2, 2] = axes[0, 0] * axes[1, 1] - axes[0, 1] * axes[1, 0]


@numba.njit(cache=True)
def connected(starts, ends, within, inside, stack, seed):
    """Mark the parts that are connected to `seed` by parts `within`; return their number."""
    size, count = 0, 1
    stack[0] = seed
    inside[seed] = True
    while count > 0:
        count -= 1
        part = stack[count]
        size += 1
        for e in range(starts[part], starts[part + 1]):
            end = ends[e]
            if within[end] == 1 and not inside[end]:
                inside[end] = True
                stack[count] = end
                count += 1
    return size
