"""Finding the boundary of a piece in another shape, and the docking motion (strings §4)."""

from __future__ import annotations

import numba
import numpy as np

from stages.variations.kernels.layout import BOUNDARY, PARTS, UPRIGHT, Outcome
from stages.variations.kernels.lookup import random_below

__all__ = ["lies_in", "looks_same", "match_poses", "move", "squared_distance", "turn_by"]


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
def looks_same(kit, part_type, turn, other):
    """`_same_turn` for a part of a type, within the pose tolerance."""
    first, last = kit.symmetry_starts[part_type], kit.symmetry_starts[part_type + 1]
    return _same_turn(kit.symmetries, first, last, turn, other, kit.limits[0] / kit.reach[part_type])


@numba.njit(cache=True)
def part_at(places, by_type, first, last, place, tolerance):
    """Which of the parts `by_type[first:last]` stands at a place, or -1."""
    limit = tolerance * tolerance
    for k in range(first, last):
        part = by_type[k]
        if squared_distance(places[part], place) <= limit:
            return part
    return -1


@numba.njit(cache=True)
def squared_distance(p, q):
    """The squared distance of two points."""
    x, y, z = p[0] - q[0], p[1] - q[1], p[2] - q[2]
    return x * x + y * y + z * z


@numba.njit(cache=True)
def move(motion, place, out):
    for i in range(3):
        out[i] = motion[i, 0] * place[0] + motion[i, 1] * place[1] + motion[i, 2] * place[2] + motion[3, i]


@numba.njit(cache=True)
def turn_by(motion, turn, out):
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
        turn_by(ws.motion, a.turns[part], turn)
        symmetry = looks_same(kit, part_type, turn, b.turns[image])
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
    offset = random_below(rng, fewest * turns)
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
            move(motion, a.places[part], place)
            part_type = a.types[part]
            at = part_at(
                b.places, b.by_type, b.type_starts[part_type], b.type_starts[part_type + 1], place, kit.limits[0]
            )
            if at < 0:
                found = False
                break
            turn_by(motion, a.turns[part], turn)
            if looks_same(kit, part_type, turn, b.turns[at]) < 0:
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
            turn_by(b.turns[b.by_type[at]], kit.symmetries[symmetry], between)
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
                move(motion, ws.places[v], place)
                found = part_at(b.places, b.by_type, first, last, place, kit.limits[0])
                if found >= 0:
                    turn_by(motion, ws.turns[v], turn)
                if found < 0 or looks_same(kit, part_type, turn, b.turns[found]) < 0:
                    inside = False
                    break
            if inside:
                return True
    return False
