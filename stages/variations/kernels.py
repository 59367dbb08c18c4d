"""Compiled kernels of one try: cut a piece out of one shape, match its boundary in another, join, check.

All arrays live in four tuples: `KitTables` (fixed for a kit), `ShapeTables` (fixed for a shape), `Answers` (contact
answers by relative pose) and `Workspace` (the try in hand). Indices below: `s` parts of the source shape A, `t`
parts of the target shape B, `v` parts of the variant.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np

__all__ = [
    "Answers",
    "KitTables",
    "Outcome",
    "ShapeTables",
    "Workspace",
    "connect",
    "cut",
    "hash_key",
    "join",
    "lies_in",
    "match_poses",
    "quantise",
    "refinement_keys",
    "validate",
]


class KitTables(NamedTuple):
    """A kit for the kernels.

    symmetry_starts int64 (types + 1,), symmetries float64 (s, 3, 3): rotations of each type's group;
    boxes float64 (types, 2, 3): centre and half extents in part coordinates; reach float64 (types,): half diagonals;
    weights uint64 (types,): multiset weights; allowed uint64 (r,): sorted keys of the grammar's neighbourhoods;
    limits float64 (3,): pose tolerance, contact tolerance, quantum of the answers; up: the axis that docking motions
    must keep upright, or -1.
    """

    symmetry_starts: np.ndarray
    symmetries: np.ndarray
    boxes: np.ndarray
    reach: np.ndarray
    weights: np.ndarray
    allowed: np.ndarray
    limits: np.ndarray
    up: int


class ShapeTables(NamedTuple):
    """A shape for the kernels: types int64 (n,), turns float64 (n, 3, 3), places float64 (n, 3), the shape graph as
    starts int64 (n + 1,), ends int64 (2 m,), labels int64 (2 m,) seen from the start, and the parts of each type as
    type_starts int64 (types + 1,), by_type int64 (n,).
    """

    types: np.ndarray
    turns: np.ndarray
    places: np.ndarray
    starts: np.ndarray
    ends: np.ndarray
    labels: np.ndarray
    type_starts: np.ndarray
    by_type: np.ndarray


class Answers(NamedTuple):
    """An open-addressing table: keys uint64 (c,), 0 where free; values int64 (c,), see `join`."""

    keys: np.ndarray
    values: np.ndarray


class Workspace(NamedTuple):
    """The try in hand, for variants of at most `len(types)` parts."""

    inside: np.ndarray  # bool, part of A is in the piece
    boundary: np.ndarray  # int64, boundary parts of A
    images: np.ndarray  # int64, their images in B
    image_of: np.ndarray  # int64, B part -> A part it stands for, or -1
    component: np.ndarray  # int64, component of each part of B without the boundary
    keep: np.ndarray  # bool, component is kept
    stack: np.ndarray  # int64 scratch
    motion: np.ndarray  # float64 (4, 3): rotation rows and translation, A -> B
    from_a: np.ndarray  # int64, A part -> v or -1
    from_b: np.ndarray  # int64, B part -> v or -1
    types: np.ndarray  # int64 (v,)
    turns: np.ndarray  # float64 (v, 3, 3)
    places: np.ndarray  # float64 (v, 3)
    origin: np.ndarray  # int64 (v,): 0 only in A, 1 only in B, 2 in both
    stamp: np.ndarray  # int64 (v, v): number of the try that set the label
    label: np.ndarray  # int64 (v, v): directed docking label
    edges: np.ndarray  # int64 (e, 2)
    unknown: np.ndarray  # int64 (u, 2): pairs whose contact is not yet known
    colour: np.ndarray  # uint64 (v,)
    fresh: np.ndarray  # uint64 (v,)
    boxes: np.ndarray  # float64 (v, 2, 3)
    near: np.ndarray  # int64 (p, 2): pairs whose boxes overlap
    counts: np.ndarray  # int64 (8,): edges, unknown, variant parts, boundary parts, try number, piece's parts


class _Outcomes(NamedTuple):
    """What a kernel says of a try."""

    OK: int = 0
    WHOLE: int = 1
    NO_SUCH_PART: int = 2
    NO_MATCH: int = 3
    NOTHING_ATTACHED: int = 4
    TOO_SMALL: int = 5
    TOO_LARGE: int = 6
    CLASH: int = 7
    GRAMMAR: int = 8
    UNKNOWN: int = 9


Outcome = _Outcomes()
EDGES, UNKNOWNS, PARTS, BOUNDARY, TRY, PIECE = 0, 1, 2, 3, 4, 5
GROWN, PLANES, JOINTS = 0, 1, 2
NONE, FORBIDDEN, MISSING = -1, -2, -9
LABELS = 1 << 20
CHOICES = 64
UPRIGHT = 0.999


@numba.njit(cache=True)
def quantise(first_turn, first_place, turn, place, reach, quantum, out):
    """The pose of the second part in coordinates of the first in whole quanta, int64 (12,): translation, rotation."""
    for i in range(3):
        x = 0.0
        for k in range(3):
            x += first_turn[k, i] * (place[k] - first_place[k])
        out[i] = np.int64(np.floor(x / quantum + 0.5))
        for j in range(3):
            y = 0.0
            for k in range(3):
                y += first_turn[k, i] * turn[k, j]
            out[3 + 3 * i + j] = np.int64(np.floor(y * reach / quantum + 0.5))


@numba.njit(cache=True, inline="always")
def _mix(x):
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return x ^ (x >> np.uint64(31))


@numba.njit(cache=True)
def hash_key(a, b, quanta):
    """A key of a type pair and a quantised pose, uint64, never 0."""
    x = _mix(np.uint64(a) * np.uint64(0x9E3779B97F4A7C15) + np.uint64(b) + np.uint64(1))
    for k in range(12):
        x = _mix(x * np.uint64(0x9E3779B97F4A7C15) + np.uint64(quanta[k]))
    return x | np.uint64(1)


@numba.njit(cache=True)
def _ask(keys, values, key):
    mask = np.uint64(len(keys) - 1)
    slot = key & mask
    while keys[slot] != np.uint64(0):
        if keys[slot] == key:
            return values[slot]
        slot = (slot + np.uint64(1)) & mask
    return MISSING


@numba.njit(cache=True)
def _random_below(rng, n):
    return min(np.int64(rng.random() * n), n - 1)


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
            part_type = shape.types[_random_below(rng, n)]
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
    seed = _random_below(rng, n)
    if way == JOINTS:
        return _cut_at_joints(rng, shape, other, ws, seed)
    if way == GROWN:
        wanted = 1 + _random_below(rng, n - 1)
        size, count = 0, 1
        stack[0] = seed
        while count > 0 and size < wanted:
            pick = _random_below(rng, count)
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
        chosen = _random_below(rng, n)
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
    kind = _random_below(rng, 3)
    used = 1 if kind < 2 else 3
    first = _random_below(rng, 3)
    low = np.empty(3)
    high = np.empty(3)
    other = _random_below(rng, n)
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
def _same_turn(symmetries, first, last, turn, other, slack):
    """Whether two rotations of a part look the same, entries within `slack` together; the symmetry or -1."""
    limit = slack * slack
    between = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            x = 0.0
            for k in range(3):
                x += other[k, i] * turn[k, j]
            between[i, j] = x
    for index in range(first, last):
        gap = 0.0
        for i in range(3):
            for j in range(3):
                d = between[i, j] - symmetries[index, i, j]
                gap += d * d
        if gap <= limit:
            return index
    return -1


@numba.njit(cache=True)
def _looks_same(kit, part_type, turn, other):
    """`_same_turn` for a part of a type, within the pose tolerance."""
    first, last = kit.symmetry_starts[part_type], kit.symmetry_starts[part_type + 1]
    return _same_turn(kit.symmetries, first, last, turn, other, kit.limits[0] / kit.reach[part_type])


@numba.njit(cache=True)
def _part_at(places, by_type, first, last, place, tolerance):
    """Which of the parts `by_type[first:last]` stands at a place, or -1."""
    limit = tolerance * tolerance
    for k in range(first, last):
        part = by_type[k]
        x, y, z = places[part, 0] - place[0], places[part, 1] - place[1], places[part, 2] - place[2]
        if x * x + y * y + z * z <= limit:
            return part
    return -1


@numba.njit(cache=True)
def _move(motion, place, out):
    for i in range(3):
        out[i] = motion[i, 0] * place[0] + motion[i, 1] * place[1] + motion[i, 2] * place[2] + motion[3, i]


@numba.njit(cache=True)
def _turn(motion, turn, out):
    for i in range(3):
        for j in range(3):
            out[i, j] = motion[i, 0] * turn[0, j] + motion[i, 1] * turn[1, j] + motion[i, 2] * turn[2, j]


@numba.njit(cache=True)
def _fit_motion(kit, a, b, ws):
    """The docking motion refitted to all boundary parts in the least squares sense, by SVD of their covariance and
    without turning handedness (strings §4). Each part counts with its centroid and its three axes, so one boundary
    part or a row of them settles the motion too."""
    count = ws.counts[BOUNDARY]
    centre_a, centre_b = np.zeros(3), np.zeros(3)
    for k in range(count):
        for i in range(3):
            centre_a[i] += a.places[ws.boundary[k], i] / count
            centre_b[i] += b.places[ws.images[k], i] / count
    covariance = np.zeros((3, 3))
    turn, target = np.empty((3, 3)), np.empty((3, 3))
    for k in range(count):
        part, image = ws.boundary[k], ws.images[k]
        part_type = a.types[part]
        _turn(ws.motion, a.turns[part], turn)
        symmetry = _looks_same(kit, part_type, turn, b.turns[image])
        weight = kit.reach[part_type] ** 2 / 3.0
        for i in range(3):
            for j in range(3):
                x = 0.0
                for axis in range(3):
                    x += b.turns[image, i, axis] * kit.symmetries[symmetry, axis, j]
                target[i, j] = x
        for i in range(3):
            for j in range(3):
                x = (a.places[part, i] - centre_a[i]) * (b.places[image, j] - centre_b[j])
                for axis in range(3):
                    x += weight * a.turns[part, i, axis] * target[j, axis]
                covariance[i, j] += x
    u, _, vt = np.linalg.svd(covariance)
    old = ws.motion[:3]
    handed = np.linalg.det(old) * np.linalg.det(u) * np.linalg.det(vt)
    for i in range(3):
        for j in range(3):
            x = vt[0, i] * u[j, 0] + vt[1, i] * u[j, 1]
            ws.motion[i, j] = x + (vt[2, i] * u[j, 2] if handed > 0 else -vt[2, i] * u[j, 2])
    for i in range(3):
        ws.motion[3, i] = centre_b[i]
        for j in range(3):
            ws.motion[3, i] -= ws.motion[i, j] * centre_a[j]


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


@numba.njit(cache=True)
def match_poses(rng, kit, a, b, same_shape, ws):
    """Look for the boundary of the piece in B by the poses of its parts modulo symmetry, from the part of the rarest
    type on; the images go to `ws.images`, the docking motion to `ws.motion`. The first match in random order counts.
    """
    count = ws.counts[BOUNDARY]
    anchor = ws.boundary[0]
    anchor_type = a.types[anchor]
    fewest = b.type_starts[anchor_type + 1] - b.type_starts[anchor_type]
    symmetry = kit.symmetry_starts[anchor_type]
    turns = kit.symmetry_starts[anchor_type + 1] - symmetry
    offset = _random_below(rng, fewest * turns)
    place = np.empty(3)
    turn = np.empty((3, 3))
    between = np.empty((3, 3))
    motion = ws.motion
    for step in range(fewest * turns):
        choice = (offset + step) % (fewest * turns)
        image = b.by_type[b.type_starts[anchor_type] + choice // turns]
        if same_shape and image == anchor and choice % turns == 0:
            continue
        rotation = kit.symmetries[symmetry + choice % turns]
        for i in range(3):
            for j in range(3):
                x = 0.0
                for k in range(3):
                    x += b.turns[image, i, k] * rotation[k, j]
                between[i, j] = x
        for i in range(3):
            for j in range(3):
                x = 0.0
                for k in range(3):
                    x += between[i, k] * a.turns[anchor, j, k]
                motion[i, j] = x
        if kit.up >= 0 and motion[kit.up, kit.up] < UPRIGHT:
            continue
        for i in range(3):
            motion[3, i] = b.places[image, i]
            for j in range(3):
                motion[3, i] -= motion[i, j] * a.places[anchor, j]
        ws.images[0] = image
        found = True
        for k in range(1, count):
            part = ws.boundary[k]
            _move(motion, a.places[part], place)
            part_type = a.types[part]
            at = _part_at(
                b.places, b.by_type, b.type_starts[part_type], b.type_starts[part_type + 1], place, kit.limits[0]
            )
            if at < 0:
                found = False
                break
            _turn(motion, a.turns[part], turn)
            if _looks_same(kit, part_type, turn, b.turns[at]) < 0:
                found = False
                break
            ws.images[k] = at
        if found:
            _fit_motion(kit, a, b, ws)
            return Outcome.OK
    return Outcome.NO_MATCH


@numba.njit(cache=True)
def lies_in(kit, ws, b):
    """Whether the variant is nothing but parts of B: each of its parts stands for one of B under one rigid motion."""
    n = ws.counts[PARTS]
    if n > len(b.types):
        return False
    anchor, fewest = 0, 1 << 30
    for v in range(n):
        present = b.type_starts[ws.types[v] + 1] - b.type_starts[ws.types[v]]
        if present == 0:
            return False
        if present < fewest:
            anchor, fewest = v, present
    anchor_type = ws.types[anchor]
    place = np.empty(3)
    turn = np.empty((3, 3))
    between = np.empty((3, 3))
    motion = np.empty((4, 3))
    for at in range(b.type_starts[anchor_type], b.type_starts[anchor_type + 1]):
        for symmetry in range(kit.symmetry_starts[anchor_type], kit.symmetry_starts[anchor_type + 1]):
            _turn(b.turns[b.by_type[at]], kit.symmetries[symmetry], between)
            for i in range(3):
                for j in range(3):
                    x = 0.0
                    for k in range(3):
                        x += between[i, k] * ws.turns[anchor, j, k]
                    motion[i, j] = x
            for i in range(3):
                motion[3, i] = b.places[b.by_type[at], i]
                for j in range(3):
                    motion[3, i] -= motion[i, j] * ws.places[anchor, j]
            inside = True
            for v in range(n):
                part_type = ws.types[v]
                first, last = b.type_starts[part_type], b.type_starts[part_type + 1]
                _move(motion, ws.places[v], place)
                found = _part_at(b.places, b.by_type, first, last, place, kit.limits[0])
                if found >= 0:
                    _turn(motion, ws.turns[v], turn)
                if found < 0 or _looks_same(kit, part_type, turn, b.turns[found]) < 0:
                    inside = False
                    break
            if inside:
                return True
    return False


@numba.njit(cache=True)
def _set_edge(stamp, label, edges, counts, i, j, label_ij, label_ji):
    if stamp[i, j] != counts[TRY]:
        stamp[i, j] = counts[TRY]
        stamp[j, i] = counts[TRY]
        edges[counts[EDGES], 0] = i
        edges[counts[EDGES], 1] = j
        counts[EDGES] += 1
    label[i, j] = label_ij
    label[j, i] = label_ji


@numba.njit(cache=True)
def _place_boxes(type_boxes, types, turns, places, count, boxes):
    """The axis-aligned boxes around the parts as centre and half extents."""
    for v in range(count):
        for i in range(3):
            centre, half = places[v, i], 0.0
            for j in range(3):
                centre += turns[v, i, j] * type_boxes[types[v], 0, j]
                half += abs(turns[v, i, j]) * type_boxes[types[v], 1, j]
            boxes[v, 0, i] = centre
            boxes[v, 1, i] = half


@numba.njit(cache=True)
def _choose_components(rng, kit, a, b, ws, components):
    """Choose which components of B without the boundary stay, in `ws.keep`: the first choice in random order with
    which the neighbourhoods of all boundary parts are in the grammar. False where there is none."""
    count = ws.counts[BOUNDARY]
    limit = kit.limits[0] ** 2
    place = np.empty(3)
    base = np.zeros(count, dtype=np.uint64)
    gain = np.zeros((components, count), dtype=np.uint64)
    touched = np.zeros(components, dtype=np.bool_)
    for k in range(count):
        part, image = ws.boundary[k], ws.images[k]
        base[k] = _mix(kit.weights[a.types[part]])
        for f in range(a.starts[part], a.starts[part + 1]):
            if ws.inside[a.ends[f]]:
                base[k] += kit.weights[a.types[a.ends[f]]]
        for e in range(b.starts[image], b.starts[image + 1]):
            end = b.ends[e]
            if ws.image_of[end] >= 0:
                continue
            touched[ws.component[end]] = True
            brought = False
            for f in range(a.starts[part], a.starts[part + 1]):
                near = a.ends[f]
                if ws.inside[near] and a.types[near] == b.types[end]:
                    _move(ws.motion, a.places[near], place)
                    gap = 0.0
                    for j in range(3):
                        d = place[j] - b.places[end, j]
                        gap += d * d
                    if gap <= limit:
                        brought = True
                        break
            if not brought:
                gain[ws.component[end], k] += kit.weights[b.types[end]]
    free = np.flatnonzero(touched)
    choices = CHOICES if len(free) > 6 else (1 << len(free)) - 1
    offset = _random_below(rng, choices) if choices > 0 else 0
    for step in range(choices):
        chosen = 1 + (offset + step) % choices
        for c in range(components):
            ws.keep[c] = False
        for c in range(len(free)):
            if len(free) > 6:
                ws.keep[free[c]] = rng.random() < 0.7
            else:
                ws.keep[free[c]] = (chosen >> c) & 1 == 1
        fits = True
        for k in range(count):
            total = base[k]
            for c in range(len(free)):
                if ws.keep[free[c]]:
                    total += gain[free[c], k]
            at = np.searchsorted(kit.allowed, total)
            if at == len(kit.allowed) or kit.allowed[at] != total:
                fits = False
                break
        if fits:
            return True
    return False


@numba.njit(cache=True)
def join(rng, kit, a, b, ws, smallest, largest):
    """Put the piece of A, moved, in place of a part of B that its boundary cuts off.

    The boundary parts stand for their images. Of B without the images, components stay so that the neighbourhood of
    each boundary part is in the grammar; parts of them that coincide with parts of the piece are one with these.
    Fills the variant's parts and the edges it inherits.
    """
    na, nb = len(a.types), len(b.types)
    count = ws.counts[BOUNDARY]
    motion = ws.motion
    ws.counts[TRY] += 1
    ws.counts[EDGES] = 0
    ws.counts[UNKNOWNS] = 0
    ws.image_of[:nb] = -1
    for k in range(count):
        ws.image_of[ws.images[k]] = ws.boundary[k]
    ws.component[:nb] = -1
    components = 0
    for seed in range(nb):
        if ws.component[seed] >= 0 or ws.image_of[seed] >= 0:
            continue
        ws.component[seed] = components
        ws.stack[0] = seed
        depth = 1
        while depth > 0:
            depth -= 1
            part = ws.stack[depth]
            for e in range(b.starts[part], b.starts[part + 1]):
                end = b.ends[e]
                if ws.component[end] < 0 and ws.image_of[end] < 0:
                    ws.component[end] = components
                    ws.stack[depth] = end
                    depth += 1
        components += 1
    if not _choose_components(rng, kit, a, b, ws, components):
        return Outcome.GRAMMAR
    limit = kit.limits[0] ** 2
    size = 0
    for part in range(na):
        if ws.inside[part]:
            size += 1
    kept = 0
    for part in range(nb):
        if ws.component[part] >= 0 and ws.keep[ws.component[part]]:
            kept += 1
    if size + kept < smallest:
        return Outcome.TOO_SMALL
    if max(size, kept + count) > largest or size + kept > len(ws.types):
        return Outcome.TOO_LARGE
    v = 0
    ws.from_a[:na] = -1
    ws.from_b[:nb] = -1
    for part in range(na):
        if ws.inside[part]:
            ws.from_a[part] = v
            ws.types[v] = a.types[part]
            _move(motion, a.places[part], ws.places[v])
            _turn(motion, a.turns[part], ws.turns[v])
            ws.origin[v] = 0
            v += 1
    from_piece = v
    for k in range(count):
        ws.from_b[ws.images[k]] = ws.from_a[ws.boundary[k]]
        ws.origin[ws.from_a[ws.boundary[k]]] = 2
    for part in range(nb):
        if ws.component[part] < 0 or not ws.keep[ws.component[part]]:
            continue
        same = -1
        for u in range(from_piece):
            if ws.types[u] == b.types[part]:
                gap = 0.0
                for j in range(3):
                    d = ws.places[u, j] - b.places[part, j]
                    gap += d * d
                    if gap > limit:
                        break
                if gap <= limit:
                    same = u
                    break
        if same >= 0:
            if ws.origin[same] != 0 or _looks_same(kit, ws.types[same], ws.turns[same], b.turns[part]) < 0:
                return Outcome.CLASH
            ws.origin[same] = 2
            ws.from_b[part] = same
            continue
        ws.from_b[part] = v
        ws.types[v] = b.types[part]
        for i in range(3):
            ws.places[v, i] = b.places[part, i]
            for j in range(3):
                ws.turns[v, i, j] = b.turns[part, i, j]
        ws.origin[v] = 1
        v += 1
    ws.counts[PARTS] = v
    if v < smallest:
        return Outcome.TOO_SMALL
    if v > largest:
        return Outcome.TOO_LARGE
    if v == from_piece:
        return Outcome.NOTHING_ATTACHED
    for side in range(2):
        shape = a if side == 0 else b
        index = ws.from_a if side == 0 else ws.from_b
        for part in range(len(shape.types)):
            i = index[part]
            if i < 0:
                continue
            for e in range(shape.starts[part], shape.starts[part + 1]):
                end = shape.ends[e]
                j = index[end]
                if j >= 0 and part < end:
                    back = -1
                    for f in range(shape.starts[end], shape.starts[end + 1]):
                        if shape.ends[f] == part:
                            back = shape.labels[f]
                            break
                    _set_edge(ws.stamp, ws.label, ws.edges, ws.counts, i, j, shape.labels[e], back)
    _place_boxes(kit.boxes, ws.types, ws.turns, ws.places, v, ws.boxes)
    return Outcome.OK


@numba.njit(cache=True, inline="always")
def _boxes_apart(boxes, i, j, slack):
    return (
        abs(boxes[i, 0, 0] - boxes[j, 0, 0]) > boxes[i, 1, 0] + boxes[j, 1, 0] + slack
        or abs(boxes[i, 0, 1] - boxes[j, 0, 1]) > boxes[i, 1, 1] + boxes[j, 1, 1] + slack
        or abs(boxes[i, 0, 2] - boxes[j, 0, 2]) > boxes[i, 1, 2] + boxes[j, 1, 2] + slack
    )


@numba.njit(cache=True)
def _overlaps(boxes, count, origin, between_sides, slack, pairs):
    """Pairs i < j of overlapping boxes; with `between_sides` only those of a part of A alone and one of B alone, the
    former first. Their number; a number of -1 says that `pairs` is too short."""
    found = 0
    for i in range(count):
        if between_sides and origin[i] != 0:
            continue
        for j in range(0 if between_sides else i + 1, count):
            if between_sides and origin[j] != 1:
                continue
            if not _boxes_apart(boxes, i, j, slack):
                if found == len(pairs):
                    return -1
                pairs[found, 0] = i
                pairs[found, 1] = j
                found += 1
    return found


@numba.njit(cache=True)
def _contact(kit, answers, ws, i, j, quanta):
    """The answer for a pair: GROWN, PLANES, JOINTS = 0, 1, 2
    NONE, FORBIDDEN, MISSING or a packed pair of labels."""
    quantise(ws.turns[i], ws.places[i], ws.turns[j], ws.places[j], kit.reach[ws.types[j]], kit.limits[2], quanta)
    return _ask(answers.keys, answers.values, hash_key(ws.types[i], ws.types[j], quanta))


@numba.njit(cache=True)
def _grammar_holds(kit, ws, open_pairs):
    """Whether every part's multiset of neighbour types is allowed, but for the parts in the first `open_pairs` rows of
    `ws.near`."""
    v = ws.counts[PARTS]
    for i in range(v):
        ws.fresh[i] = _mix(kit.weights[ws.types[i]])
    for e in range(ws.counts[EDGES]):
        i, j = ws.edges[e, 0], ws.edges[e, 1]
        ws.fresh[i] += kit.weights[ws.types[j]]
        ws.fresh[j] += kit.weights[ws.types[i]]
    for k in range(open_pairs):
        ws.fresh[ws.near[k, 0]] = kit.allowed[0]
        ws.fresh[ws.near[k, 1]] = kit.allowed[0]
    for i in range(v):
        at = np.searchsorted(kit.allowed, ws.fresh[i])
        if at == len(kit.allowed) or kit.allowed[at] != ws.fresh[i]:
            return False
    return True


@numba.njit(cache=True)
def connect(kit, answers, ws):
    """Add the contacts between parts that came from A alone and from B alone, then check the grammar.

    With UNKNOWN the pairs in `ws.unknown` must be answered first. What comes out in the end, down to the reason of a
    refusal, is the same whatever was known: first the grammar of the parts that no such contact can change, then
    forbidden contacts, then the grammar of all parts.
    """
    v = ws.counts[PARTS]
    ws.counts[UNKNOWNS] = 0
    quanta = np.empty(12, dtype=np.int64)
    pairs = _overlaps(ws.boxes, v, ws.origin, True, 1.1 * kit.limits[1], ws.near)
    if pairs < 0:
        return Outcome.TOO_LARGE
    if not _grammar_holds(kit, ws, pairs):
        return Outcome.GRAMMAR
    for k in range(pairs):
        i, j = ws.near[k, 0], ws.near[k, 1]
        if ws.stamp[i, j] == ws.counts[TRY]:
            continue
        answer = _contact(kit, answers, ws, i, j, quanta)
        if answer == FORBIDDEN:
            return Outcome.CLASH
        if answer == MISSING:
            if ws.counts[UNKNOWNS] == len(ws.unknown):
                return Outcome.UNKNOWN
            ws.unknown[ws.counts[UNKNOWNS], 0] = i
            ws.unknown[ws.counts[UNKNOWNS], 1] = j
            ws.counts[UNKNOWNS] += 1
        elif answer >= 0:
            if ws.counts[EDGES] == len(ws.edges):
                return Outcome.TOO_LARGE
            _set_edge(ws.stamp, ws.label, ws.edges, ws.counts, i, j, answer // LABELS, answer % LABELS)
    if ws.counts[UNKNOWNS] > 0:
        return Outcome.UNKNOWN
    return Outcome.OK if _grammar_holds(kit, ws, 0) else Outcome.GRAMMAR


@numba.njit(cache=True)
def validate(kit, answers, ws):
    """Compute the variant's whole shape graph anew from its poses and hold it against the predicted one.

    OK where they are the same, CLASH where they differ, UNKNOWN where pairs must be answered first.
    """
    v = ws.counts[PARTS]
    ws.counts[UNKNOWNS] = 0
    quanta = np.empty(12, dtype=np.int64)
    seen = 0
    pairs = _overlaps(ws.boxes, v, ws.origin, False, 1.1 * kit.limits[1], ws.near)
    if pairs < 0:
        return Outcome.TOO_LARGE
    for k in range(pairs):
        i, j = ws.near[k, 0], ws.near[k, 1]
        answer = _contact(kit, answers, ws, i, j, quanta)
        if answer == MISSING:
            if ws.counts[UNKNOWNS] == len(ws.unknown):
                return Outcome.UNKNOWN
            ws.unknown[ws.counts[UNKNOWNS], 0] = i
            ws.unknown[ws.counts[UNKNOWNS], 1] = j
            ws.counts[UNKNOWNS] += 1
            continue
        predicted = ws.stamp[i, j] == ws.counts[TRY]
        if answer == FORBIDDEN or (answer >= 0) != predicted:
            return Outcome.CLASH
        if predicted:
            if ws.label[i, j] != answer // LABELS or ws.label[j, i] != answer % LABELS:
                return Outcome.CLASH
            seen += 1
    if ws.counts[UNKNOWNS] > 0:
        return Outcome.UNKNOWN
    return Outcome.OK if seen == ws.counts[EDGES] else Outcome.CLASH


@numba.njit(cache=True)
def _refine(ws, with_labels):
    """Colour refinement of the variant's graph; a hash that isomorphic graphs share."""
    v, edges = ws.counts[PARTS], ws.counts[EDGES]
    for i in range(v):
        ws.colour[i] = _mix(np.uint64(ws.types[i]) + np.uint64(0x51ED270B))
    classes = 0
    ranked = np.empty(v, dtype=np.uint64)
    for _ in range(v):
        for i in range(v):
            ws.fresh[i] = _mix(ws.colour[i])
        for e in range(edges):
            i, j = ws.edges[e, 0], ws.edges[e, 1]
            to_j = np.uint64(ws.label[i, j]) if with_labels else np.uint64(0)
            to_i = np.uint64(ws.label[j, i]) if with_labels else np.uint64(0)
            ws.fresh[i] += _mix(ws.colour[j] + to_j * np.uint64(0x9E3779B97F4A7C15) + np.uint64(0x7F4A7C15))
            ws.fresh[j] += _mix(ws.colour[i] + to_i * np.uint64(0x9E3779B97F4A7C15) + np.uint64(0x7F4A7C15))
        for i in range(v):
            ws.colour[i] = ws.fresh[i]
            ranked[i] = ws.fresh[i]
        ranked.sort()
        found = 1
        for i in range(1, v):
            if ranked[i] != ranked[i - 1]:
                found += 1
        if found == classes:
            break
        classes = found
    total = np.uint64(v)
    for i in range(v):
        total += _mix(ranked[i])
    return _mix(total)


@numba.njit(cache=True)
def refinement_keys(ws):
    """Two hashes of the variant by colour refinement: of its graph, and of its graph with docking labels. Equal
    graphs have equal keys; different keys mean different graphs."""
    return _refine(ws, False), _refine(ws, True)
