"""Spots: places where parts may stand, found again by position, and what standing parts say of them."""

from __future__ import annotations

import numba
import numpy as np

from stages.shape.geometry.contact_lookup import call_oracle, contact_key, look_up, mix, quantize_pose
from stages.shape.geometry.pose_kernels import same_rotation, squared_distance
from stages.variations.growth.state import FREE, GROWN_PARTS, NODES, SPOTS, WORK
from stages.variations.kernels.structs import FORBIDDEN, MISSING, NONE

FORBIDS = -1
"""In place of a node's count: the part forbids the spot."""
FULL = -2
"""There is no room for another spot."""
WIDTH = 8.0
"""Side of the buckets in pose tolerances."""


@numba.njit(cache=True)
def _bucket(x, y, z, buckets):
    key = mix(np.uint64(x) * np.uint64(0x9E3779B97F4A7C15) + np.uint64(1))
    key = mix(key + np.uint64(y) * np.uint64(0xBF58476D1CE4E5B9))
    key = mix(key + np.uint64(z) * np.uint64(0x94D049BB133111EB))
    return np.int64(key & np.uint64(buckets - 1))


@numba.njit(cache=True)
def find_spot(
    symmetry_starts, symmetries, tolerance, slack, spot_types, spot_rotations, spot_translations, buckets, chains,
    part_type, rotation, translation,
):  # fmt: skip
    """The spot of a type at a pose, modulo symmetry, or -1; `slack` is how much entries of rotations that look the
    same may differ."""
    width = WIDTH * tolerance
    first, last = symmetry_starts[part_type], symmetry_starts[part_type + 1]
    low_x = np.int64(np.floor((translation[0] - tolerance) / width))
    low_y = np.int64(np.floor((translation[1] - tolerance) / width))
    low_z = np.int64(np.floor((translation[2] - tolerance) / width))
    for x in range(low_x, np.int64(np.floor((translation[0] + tolerance) / width)) + 1):
        for y in range(low_y, np.int64(np.floor((translation[1] + tolerance) / width)) + 1):
            for z in range(low_z, np.int64(np.floor((translation[2] + tolerance) / width)) + 1):
                spot = buckets[_bucket(x, y, z, len(buckets))]
                while spot >= 0:
                    if (
                        spot_types[spot] == part_type
                        and squared_distance(spot_translations[spot], translation) <= tolerance**2
                        and same_rotation(symmetries, first, last, spot_rotations[spot], rotation, slack) >= 0
                    ):
                        return spot
                    spot = chains[spot]
    return -1


@numba.njit(cache=True)
def add_spot(kit, answers, g, part_type, rotation, translation):
    """A new spot of a type at a pose, with a node for every part that has to do with it, or FULL."""
    spot = g.counts[SPOTS]
    if spot == len(g.spot_types):
        return FULL
    g.counts[SPOTS] += 1
    g.spot_types[spot] = part_type
    for i in range(3):
        g.spot_translations[spot, i] = translation[i]
        centre, half = translation[i], 0.0
        for j in range(3):
            g.spot_rotations[spot, i, j] = rotation[i, j]
            centre += rotation[i, j] * kit.boxes[part_type, 0, j]
            half += abs(rotation[i, j]) * kit.boxes[part_type, 1, j]
        g.spot_boxes[spot, 0, i] = centre
        g.spot_boxes[spot, 1, i] = half
    g.spot_parts[spot] = -1
    g.bad[spot] = 0
    g.heads[spot] = -1
    width = WIDTH * kit.limits[0]
    at = _bucket(
        np.int64(np.floor(translation[0] / width)),
        np.int64(np.floor(translation[1] / width)),
        np.int64(np.floor(translation[2] / width)),
        len(g.buckets),
    )
    g.chains[spot] = g.buckets[at]
    g.buckets[at] = spot
    # The newest part is the one whose candidates are being made; whether it has the spot is not settled yet.
    newest = g.counts[GROWN_PARTS] - 1
    boxes, part_spots, slack = g.spot_boxes, g.part_spots, 1.1 * kit.limits[1]
    for part in range(newest + 1):
        if not boxes_meet(boxes, part_spots[part], spot, slack):
            continue
        answer = relation(kit, answers, g, part_spots[part], spot)
        if answer == NONE:
            continue
        if not add_node(g, spot, part, FORBIDS if answer == FORBIDDEN else 0):
            return FULL
        if answer == FORBIDDEN or part < newest:
            g.bad[spot] += 1
    return spot


@numba.njit(cache=True)
def relation(kit, answers, g, a, b):
    """What the parts of two spots whose boxes meet are to each other: NONE, FORBIDDEN or a packed pair of labels.
    Python is asked for what is not known yet."""
    g.counts[WORK] += 1
    if (g.spot_types[a], a) > (g.spot_types[b], b):
        a, b = b, a
    quanta = np.empty(12, dtype=np.int64)
    first, second = g.spot_types[a], g.spot_types[b]
    quantize_pose(
        g.spot_rotations[a], g.spot_translations[a], g.spot_rotations[b], g.spot_translations[b], kit.reach[second],
        kit.limits[2], quanta,
    )  # fmt: skip
    answer = look_up(answers.keys, answers.values, contact_key(first, second, quanta))
    if answer == MISSING:
        answer = call_oracle(answers.oracle_address, a, b)
    return answer


@numba.njit(cache=True, inline="always")
def boxes_meet(boxes, a, b, slack):
    """Whether two boxes of `boxes` (n, 2, 3), centres and half extents, are less than `slack` apart."""
    return (
        abs(boxes[a, 0, 0] - boxes[b, 0, 0]) <= boxes[a, 1, 0] + boxes[b, 1, 0] + slack
        and abs(boxes[a, 0, 1] - boxes[b, 0, 1]) <= boxes[a, 1, 1] + boxes[b, 1, 1] + slack
        and abs(boxes[a, 0, 2] - boxes[b, 0, 2]) <= boxes[a, 1, 2] + boxes[b, 1, 2] + slack
    )


@numba.njit(cache=True)
def add_node(g, spot, part, count):
    """Join a spot with a part; False where there is no room."""
    node = g.counts[FREE]
    if node >= 0:
        g.counts[FREE] = g.node_next[node]
    else:
        node = g.counts[NODES]
        if node == len(g.node_spots):
            return False
        g.counts[NODES] += 1
    g.node_spots[node] = spot
    g.node_parts[node] = part
    g.node_counts[node] = count
    g.node_next[node] = g.heads[spot]
    g.heads[spot] = node
    return True


@numba.njit(cache=True, inline="always")
def find_node(heads, node_parts, node_next, spot, part):
    """The node between a spot and a part, or -1."""
    node = heads[spot]
    while node >= 0 and node_parts[node] != part:
        node = node_next[node]
    return node
