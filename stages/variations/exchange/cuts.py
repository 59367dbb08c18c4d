"""Cutting a connected piece out of a shape (strings §4, subgraph sampling)."""

from __future__ import annotations

import numba
import numpy as np

from stages.variations.kernels.layout import BOUNDARY, GROWN, JOINTS, PIECE, Outcome
from stages.variations.kernels.lookup import random_below

__all__ = ["cut"]


@numba.njit(cache=True)
def _cut_at_joints(rng, shape, other, ws, seed):
    """A piece that ends at parts of one or two types which the other shape has too, each with even odds of being
    passed by all the same. Returns its number of parts."""
    n = len(shape.types)
    inside, stack = ws.inside, ws.stack
    joints = np.empty(2, dtype=np.int64)
    for k in range(2):
        joints[k] = -1
        for _ in range(8):
            part_type = shape.types[random_below(rng, n)]
            if other.type_starts[part_type + 1] > other.type_starts[part_type]:
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
def _cut(rng, shape, other, ws, way):
    """A random connected piece of a shape into `ws.inside`: grown part by part (GROWN), ended at joints (JOINTS), or
    cut out by a half-space, a slab or a box along the axes of one of its parts or in any direction (PLANES). Returns
    its number of parts."""
    n = len(shape.types)
    inside, stack = ws.inside, ws.stack
    inside[:n] = False
    seed = random_below(rng, n)
    if way == JOINTS:
        return _cut_at_joints(rng, shape, other, ws, seed)
    if way == GROWN:
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
            for e in range(shape.starts[part], shape.starts[part + 1]):
                if not inside[shape.ends[e]] and count < len(stack):
                    stack[count] = shape.ends[e]
                    count += 1
        return size
    axes = np.empty((3, 3))
    if rng.random() < 0.75:
        chosen = random_below(rng, n)
        for i in range(3):
            for j in range(3):
                axes[i, j] = shape.turns[chosen, j, i]
    else:
        for i in range(2):
            norm = 0.0
            while norm < 1e-3:
                for j in range(3):
                    axes[i, j] = 2.0 * rng.random() - 1.0
                if i == 1:
                    along = axes[1, 0] * axes[0, 0] + axes[1, 1] * axes[0, 1] + axes[1, 2] * axes[0, 2]
                    for j in range(3):
                        axes[1, j] -= along * axes[0, j]
                norm = (axes[i, 0] ** 2 + axes[i, 1] ** 2 + axes[i, 2] ** 2) ** 0.5
            for j in range(3):
                axes[i, j] /= norm
        axes[2, 0] = axes[0, 1] * axes[1, 2] - axes[0, 2] * axes[1, 1]
        axes[2, 1] = axes[0, 2] * axes[1, 0] - axes[0, 0] * axes[1, 2]
        axes[2, 2] = axes[0, 0] * axes[1, 1] - axes[0, 1] * axes[1, 0]
    kind = random_below(rng, 3)
    used = 1 if kind < 2 else 3
    first = random_below(rng, 3)
    low = np.empty(3)
    high = np.empty(3)
    other = random_below(rng, n)
    for u in range(used):
        axis = (first + u) % 3
        a, b = 0.0, 0.0
        for j in range(3):
            a += axes[axis, j] * shape.places[seed, j]
            b += axes[axis, j] * shape.places[other, j]
        slack = 1e-3 * (1.0 + abs(a) + abs(b))
        if kind == 0:
            if rng.random() < 0.5:
                low[u], high[u] = a - slack, np.inf
            else:
                low[u], high[u] = -np.inf, a + slack
        else:
            low[u], high[u] = min(a, b) - slack, max(a, b) + slack
    for part in range(n):
        hit = True
        for u in range(used):
            axis = (first + u) % 3
            x = 0.0
            for j in range(3):
                x += axes[axis, j] * shape.places[part, j]
            if x < low[u] or x > high[u]:
                hit = False
                break
        ws.component[part] = 1 if hit else 0
    # Only the piece that is connected to the seed.
    size, count = 0, 1
    stack[0] = seed
    inside[seed] = True
    while count > 0:
        count -= 1
        part = stack[count]
        size += 1
        for e in range(shape.starts[part], shape.starts[part + 1]):
            end = shape.ends[e]
            if ws.component[end] == 1 and not inside[end]:
                inside[end] = True
                stack[count] = end
                count += 1
    return size


@numba.njit(cache=True)
def cut(rng, a, b, ws, way):
    """Cut a random connected piece out of A: `ws.inside`, and its boundary, the parts with a neighbour outside, in
    `ws.boundary`, that of the rarest type in B first."""
    n = len(a.types)
    size = _cut(rng, a, b, ws, way)
    count = 0
    for part in range(n):
        if ws.inside[part]:
            for e in range(a.starts[part], a.starts[part + 1]):
                if not ws.inside[a.ends[e]]:
                    ws.boundary[count] = part
                    count += 1
                    break
    ws.counts[BOUNDARY] = count
    ws.counts[PIECE] = size
    if count == 0 or size == n:
        return Outcome.WHOLE
    rarest, fewest = 0, 1 << 30
    for k in range(count):
        part_type = a.types[ws.boundary[k]]
        present = b.type_starts[part_type + 1] - b.type_starts[part_type]
        if present == 0:
            return Outcome.NO_SUCH_PART
        if present < fewest:
            rarest, fewest = k, present
    first = ws.boundary[0]
    ws.boundary[0] = ws.boundary[rarest]
    ws.boundary[rarest] = first
    return Outcome.OK
