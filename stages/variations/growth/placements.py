"""Placements: places where parts may be, found by position, and their links to placed parts."""

from __future__ import annotations

import numba
import numpy as np

from stages.shape.geometry.contact_lookup import (
    FORBIDDEN_CONTACT,
    NO_CONTACT,
    UNKNOWN_CONTACT,
    call_oracle,
    contact_key,
    quantize_pose,
)
from stages.shape.geometry.hash_tables import look_up, mix
from stages.shape.geometry.pose_kernels import same_rotation, squared_distance
from stages.variations.growth.state import FREE_LINK, N_GROWN_PARTS, N_LINKS, N_PLACEMENTS, WORK_DONE

LINK_FORBIDS = -1
"""Instead of a link's count: the part forbids the placement."""
NO_PLACEMENT = -2
"""Returned where there is no room for another placement."""
BUCKET_TOLERANCES = 8.0
"""Side of the buckets in pose tolerances."""


@numba.njit(cache=True)
def _bucket(x, y, z, buckets):
    key = mix(np.uint64(np.int64(x)) * np.uint64(0x9E3779B97F4A7C15) + np.uint64(1))
    key = mix(key + np.uint64(np.int64(y)) * np.uint64(0xBF58476D1CE4E5B9))
    key = mix(key + np.uint64(np.int64(z)) * np.uint64(0x94D049BB133111EB))
    return np.int64(key & np.uint64(buckets - 1))


@numba.njit(cache=True)
def find_placement(
    symmetry_starts, symmetries, tolerance, slack, placement_types, placement_rotations, placement_translations,
    buckets, bucket_next, part_type, rotation, translation,
):  # fmt: skip
    """Return the placement of a type at a pose, modulo symmetry, or -1. slack: tolerance of the entries of rotations"""
    width = BUCKET_TOLERANCES * tolerance
    first, last = symmetry_starts[part_type], symmetry_starts[part_type + 1]
    low_x = np.int64(np.floor((translation[0] - tolerance) / width))
    low_y = np.int64(np.floor((translation[1] - tolerance) / width))
    low_z = np.int64(np.floor((translation[2] - tolerance) / width))
    for x in range(low_x, np.int64(np.floor((translation[0] + tolerance) / width)) + 1):
        for y in range(low_y, np.int64(np.floor((translation[1] + tolerance) / width)) + 1):
            for z in range(low_z, np.int64(np.floor((translation[2] + tolerance) / width)) + 1):
                placement = buckets[_bucket(x, y, z, len(buckets))]
                while placement >= 0:
                    if (
                        placement_types[placement] == part_type
                        and squared_distance(placement_translations[placement], translation) <= tolerance**2
                        and same_rotation(symmetries, first, last, placement_rotations[placement], rotation, slack) >= 0
                    ):
                        return placement
                    placement = bucket_next[placement]
    return -1


@numba.njit(cache=True)
def add_placement(kit, contacts, state, part_type, rotation, translation):
    """Add a placement of a type at a pose, linked to the parts that forbid or touch it; return it, or NO_PLACEMENT."""
    placement = state.counts[N_PLACEMENTS]
    if placement == len(state.placement_types):
        return NO_PLACEMENT
    state.counts[N_PLACEMENTS] += 1
    state.placement_types[placement] = part_type
    for i in range(3):
        state.placement_translations[placement, i] = translation[i]
        centre, half = translation[i], 0.0
        for j in range(3):
            state.placement_rotations[placement, i, j] = rotation[i, j]
            centre += rotation[i, j] * kit.boxes[part_type, 0, j]
            half += abs(rotation[i, j]) * kit.boxes[part_type, 1, j]
        state.placement_boxes[placement, 0, i] = centre
        state.placement_boxes[placement, 1, i] = half
    state.placed_parts[placement] = -1
    state.blockers[placement] = 0
    state.first_links[placement] = -1
    width = BUCKET_TOLERANCES * kit.limits[0]
    at = _bucket(
        np.int64(np.floor(translation[0] / width)),
        np.int64(np.floor(translation[1] / width)),
        np.int64(np.floor(translation[2] / width)),
        len(state.buckets),
    )
    state.bucket_next[placement] = state.buckets[at]
    state.buckets[at] = placement
    # The candidates of the newest part are being made; whether it has the placement is not known yet.
    newest = state.counts[N_GROWN_PARTS] - 1
    boxes, part_spots, slack = state.placement_boxes, state.part_placements, 1.1 * kit.limits[1]
    for part in range(newest + 1):
        if not boxes_meet(boxes, part_spots[part], placement, slack):
            continue
        answer = relation(kit, contacts, state, part_spots[part], placement)
        if answer == NO_CONTACT:
            continue
        if not add_link(state, placement, part, LINK_FORBIDS if answer == FORBIDDEN_CONTACT else 0):
            return NO_PLACEMENT
        if answer == FORBIDDEN_CONTACT or part < newest:
            state.blockers[placement] += 1
    return placement


@numba.njit(cache=True)
def relation(kit, contacts, state, a, b):
    """Return the contact of two placements whose boxes meet: NO_CONTACT, FORBIDDEN_CONTACT or a packed pair of labels.

    Unknown contacts are asked of the oracle.
    """
    state.counts[WORK_DONE] += 1
    if (state.placement_types[a], a) > (state.placement_types[b], b):
        a, b = b, a
    quanta = np.empty(12, dtype=np.int64)
    first, second = state.placement_types[a], state.placement_types[b]
    quantize_pose(
        state.placement_rotations[a], state.placement_translations[a], state.placement_rotations[b],
        state.placement_translations[b], kit.reach[second], kit.limits[2], quanta,
    )  # fmt: skip
    answer = look_up(contacts.keys, contacts.values, contact_key(first, second, quanta))
    if answer == UNKNOWN_CONTACT:
        answer = call_oracle(contacts.oracle_address, a, b)
    return answer


@numba.njit(cache=True, inline="always")
def boxes_meet(boxes, a, b, slack):
    """Return whether two of `boxes` (n, 2, 3), centres and half extents, are less than `slack` apart."""
    return (
        abs(boxes[a, 0, 0] - boxes[b, 0, 0]) <= boxes[a, 1, 0] + boxes[b, 1, 0] + slack
        and abs(boxes[a, 0, 1] - boxes[b, 0, 1]) <= boxes[a, 1, 1] + boxes[b, 1, 1] + slack
        and abs(boxes[a, 0, 2] - boxes[b, 0, 2]) <= boxes[a, 1, 2] + boxes[b, 1, 2] + slack
    )


@numba.njit(cache=True)
def add_link(state, placement, part, count):
    """Link a placement to a part; return False where there is no room."""
    link = state.counts[FREE_LINK]
    if link >= 0:
        state.counts[FREE_LINK] = state.link_next[link]
    else:
        link = state.counts[N_LINKS]
        if link == len(state.link_placements):
            return False
        state.counts[N_LINKS] += 1
    state.link_placements[link] = placement
    state.link_parts[link] = part
    state.link_counts[link] = count
    state.link_next[link] = state.first_links[placement]
    state.first_links[placement] = link
    return True


@numba.njit(cache=True, inline="always")
def find_link(first_links, link_parts, link_next, placement, part):
    """Return the link between a placement and a part, or -1."""
    link = first_links[placement]
    while link >= 0 and link_parts[link] != part:
        link = link_next[link]
    return link
