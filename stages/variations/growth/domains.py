"""What may still stand around the parts that stand: domains of candidates, kept consistent by propagation."""

from __future__ import annotations

import numba
import numpy as np

from stages.shape.geometry.contact_lookup import mix
from stages.shape.geometry.pose_kernels import looks_same, squared_distance
from stages.variations.growth.placements import FORBIDS, add_node, add_spot, boxes_meet, find_node, find_spot, relation
from stages.variations.growth.state import CANDIDATES, EVENTS, FREE, GROWN_PARTS, MEMBERS, SPOTS, TRAIL, WORK
from stages.variations.kernels.structs import FORBIDDEN, NONE, UPRIGHT

FINE, CONFLICT, NO_ROOM = 0, 1, 2
"""How a step ended."""
LIGHT = 32
"""So many looks at a member of a pattern, or at a spot, count as one contact asked for."""
SEED_TURNS = 16
"""Symmetric images of the first part that are tried at most: round parts have hundreds, all alike."""


@numba.njit(cache=True)
def place(kit, patterns, answers, g, field, spot):
    """Put a part on a spot, find its candidates, and strike what it forbids."""
    part = g.counts[GROWN_PARTS]
    if g.bad[spot] > 0 or part == field.most:
        return CONFLICT
    if g.counts[TRAIL] == len(g.trail):
        return NO_ROOM
    g.trail[g.counts[TRAIL]] = -1 - part
    g.counts[TRAIL] += 1
    g.counts[GROWN_PARTS] += 1
    g.part_spots[part] = spot
    g.spot_parts[spot] = part
    g.have[g.spot_types[spot]] += 1
    g.alive_counts[part] = 0
    g.first_candidates[part] = g.counts[CANDIDATES]
    counts = g.counts
    counts[WORK] += counts[SPOTS] // LIGHT
    room, slack = True, 1.1 * kit.limits[1]
    boxes, heads, node_parts, node_counts = g.spot_boxes, g.heads, g.node_parts, g.node_counts
    bad, spot_parts, events = g.bad, g.spot_parts, g.events
    for other in range(counts[SPOTS]):
        if other == spot or not boxes_meet(boxes, spot, other, slack):
            continue
        answer = relation(kit, answers, g, spot, other)
        if answer != NONE:
            room = add_node(g, other, part, FORBIDS if answer == FORBIDDEN else 0) and room
            if answer == FORBIDDEN:
                bad[other] += 1
                _report(bad, events, counts, other)
    room = room and _find_candidates(kit, patterns, answers, g, field, part)
    # Spots that the part touches and has in no candidate can never be.
    for other in range(counts[SPOTS]):
        node = heads[other]
        if node >= 0 and node_parts[node] == part and node_counts[node] == 0 and spot_parts[other] < 0:
            bad[other] += 1
            _report(bad, events, counts, other)
    g.dirty[part] = True
    if not room:
        return NO_ROOM
    if g.alive_counts[part] == 0:
        return CONFLICT
    node = g.heads[spot]
    while node >= 0:
        if g.node_counts[node] != FORBIDS and not _keep_only_with(g, g.node_parts[node], spot):
            return CONFLICT
        node = g.node_next[node]
    return FINE


@numba.njit(cache=True, inline="always")
def _report(bad, events, counts, spot):
    """Say that a spot has become bad; domains are rid of it later."""
    if bad[spot] == 1 and counts[EVENTS] < len(events):
        events[counts[EVENTS]] = spot
        counts[EVENTS] += 1


@numba.njit(cache=True)
def _find_candidates(kit, patterns, answers, g, field, part):
    """Make the candidates of a part: patterns of its type with each part that it touches among their members. False
    where there is no room."""
    spot = g.part_spots[part]
    part_type = g.spot_types[spot]
    rotation, translation = g.spot_rotations[spot], g.spot_translations[spot]
    anchor, touching = -1, 0
    node = g.heads[spot]
    while node >= 0:
        if g.node_counts[node] != FORBIDS:
            anchor = g.part_spots[g.node_parts[node]]
            touching += 1
        node = g.node_next[node]
    first, last = kit.symmetry_starts[part_type], kit.symmetry_starts[part_type + 1]
    turned, point, relative = np.empty((3, 3)), np.empty(3), np.zeros(3)
    if anchor >= 0:
        for i in range(3):
            for k in range(3):
                relative[i] += rotation[k, i] * (g.spot_translations[anchor, k] - translation[k])
    else:
        last = min(last, first + SEED_TURNS)
    distance = np.sqrt((relative**2).sum())
    tolerance = kit.limits[0]
    own, end_of_own = patterns.of_type[part_type], patterns.of_type[part_type + 1]
    starts, ups, types, places = patterns.starts, patterns.ups, patterns.types, patterns.translations
    symmetries, anchor_type = kit.symmetries, g.spot_types[max(anchor, 0)]
    g.counts[WORK] += (last - first) * (starts[end_of_own] - starts[own]) // LIGHT
    for pattern in range(own, end_of_own):
        start, end = starts[pattern], starts[pattern + 1]
        for symmetry in range(first, last):
            turn = symmetries[symmetry]
            if kit.up >= 0:
                x = 0.0
                for i in range(3):
                    for j in range(3):
                        x += rotation[kit.up, i] * turn[i, j] * ups[pattern, j]
                if x < UPRIGHT:
                    continue
            fits = anchor < 0
            for member in range(start, end):
                if fits:
                    break
                if types[member] != anchor_type:
                    continue
                there = places[member]
                if abs(np.sqrt((there**2).sum()) - distance) > tolerance:
                    continue
                _turn_point(turn, there, point)
                if squared_distance(point, relative) <= tolerance**2:
                    _turn(rotation, turn, patterns.rotations[member], turned)
                    fits = looks_same(kit, anchor_type, turned, g.spot_rotations[anchor]) >= 0
            if fits and not _add_candidate(kit, patterns, answers, g, field, part, pattern, turn, touching):
                return False
    return True


@numba.njit(cache=True, inline="always")
def _turn_point(turn, point, out):
    for i in range(3):
        out[i] = turn[i, 0] * point[0] + turn[i, 1] * point[1] + turn[i, 2] * point[2]


@numba.njit(cache=True, inline="always")
def _turn(rotation, turn, other, out):
    """Put the product of three rotations into `out`."""
    for i in range(3):
        for j in range(3):
            x = 0.0
            for k in range(3):
                for m in range(3):
                    x += rotation[i, k] * turn[k, m] * other[m, j]
            out[i, j] = x


@numba.njit(cache=True)
def _add_candidate(kit, patterns, answers, g, field, part, pattern, turn, touching):
    """Add a pattern, turned, to a part's candidates where all its members may be; False where there is no room."""
    if g.counts[CANDIDATES] + 1 >= len(g.member_starts):
        return False
    spot = g.part_spots[part]
    rotation, translation = g.spot_rotations[spot], g.spot_translations[spot]
    there, turned, place_there = np.empty(3), np.empty((3, 3)), np.empty(3)
    heads, node_parts, node_next, node_counts = g.heads, g.node_parts, g.node_next, g.node_counts
    members = g.members
    types, turns, places = patterns.types, patterns.rotations, patterns.translations
    symmetry_starts, symmetries, boxes, reach = kit.symmetry_starts, kit.symmetries, kit.boxes, kit.reach
    spot_types, spot_rotations, spot_translations = g.spot_types, g.spot_rotations, g.spot_translations
    buckets, chains, tolerance = g.buckets, g.chains, kit.limits[0]
    start = g.counts[MEMBERS]
    end, key, standing = start, np.uint64(0), 0
    for member in range(patterns.starts[pattern], patterns.starts[pattern + 1]):
        if end == len(members):
            return False
        kind = types[member]
        _turn_point(turn, places[member], there)
        _turn_point(rotation, there, place_there)
        place_there += translation
        _turn(rotation, turn, turns[member], turned)
        if not _within(boxes, field.low, field.high, kind, turned, place_there):
            return True
        other = find_spot(
            symmetry_starts, symmetries, tolerance, tolerance / reach[kind], spot_types, spot_rotations,
            spot_translations, buckets, chains, kind, turned, place_there,
        )  # fmt: skip
        if other < 0:
            other = add_spot(kit, answers, g, kind, turned, place_there)
        if other < 0:
            return False
        node = find_node(heads, node_parts, node_next, other, part)
        if node < 0 or node_counts[node] == FORBIDS:
            return True
        if g.spot_parts[other] >= 0:
            standing += 1
        elif g.bad[other] > 0:
            return True
        members[end] = other
        end += 1
        key += mix(np.uint64(other) + np.uint64(1))
    if standing != touching:
        return True
    for known in range(g.first_candidates[part], g.counts[CANDIDATES]):
        if g.hashes[known] == key:
            g.weights[known] += patterns.weights[pattern]
            return True
    candidate = g.counts[CANDIDATES]
    g.counts[CANDIDATES] += 1
    g.counts[MEMBERS] = end
    g.member_starts[candidate] = start
    g.member_starts[candidate + 1] = end
    g.candidate_parts[candidate] = part
    g.patterns[candidate] = pattern
    g.weights[candidate] = patterns.weights[pattern]
    g.hashes[candidate] = key
    g.alive[candidate] = True
    g.alive_counts[part] += 1
    for k in range(start, end):
        node_counts[find_node(heads, node_parts, node_next, members[k], part)] += 1
    return True


@numba.njit(cache=True)
def _within(boxes, low, high, part_type, rotation, translation):
    """Whether a part at a pose lies between two corners."""
    for i in range(3):
        centre, half = translation[i], 0.0
        for j in range(3):
            centre += rotation[i, j] * boxes[part_type, 0, j]
            half += abs(rotation[i, j]) * boxes[part_type, 1, j]
        if centre - half < low[i] or centre + half > high[i]:
            return False
    return True


@numba.njit(cache=True, inline="always")
def _has(member_starts, members, candidate, spot):
    k, end = member_starts[candidate], member_starts[candidate + 1]
    while k < end and members[k] != spot:
        k += 1
    return k < end


@numba.njit(cache=True)
def _keep_only_with(g, part, spot):
    """Strike the candidates of a part that lack a spot; False where none is left."""
    candidate, count = g.first_candidates[part], g.alive_counts[part]
    alive, member_starts, members = g.alive, g.member_starts, g.members
    while count > 0:
        if alive[candidate]:
            count -= 1
            if not _has(member_starts, members, candidate, spot) and not strike(g, candidate):
                return False
        candidate += 1
    return True


@numba.njit(cache=True)
def strike(g, candidate):
    """Take a candidate out of its part's domain; False where the domain is empty then."""
    part = g.candidate_parts[candidate]
    g.alive[candidate] = False
    g.alive_counts[part] -= 1
    g.dirty[part] = True
    g.trail[g.counts[TRAIL]] = candidate
    g.counts[TRAIL] += 1
    heads, node_parts, node_next, node_counts = g.heads, g.node_parts, g.node_next, g.node_counts
    members, bad, spot_parts, events, counts = g.members, g.bad, g.spot_parts, g.events, g.counts
    for k in range(g.member_starts[candidate], g.member_starts[candidate + 1]):
        spot = members[k]
        node = find_node(heads, node_parts, node_next, spot, part)
        node_counts[node] -= 1
        if node_counts[node] == 0 and spot_parts[spot] < 0:
            bad[spot] += 1
            _report(bad, events, counts, spot)
    return g.alive_counts[part] > 0


@numba.njit(cache=True)
def narrow(g, candidate):
    """Make a candidate the only one of its part."""
    part = g.candidate_parts[candidate]
    for other in range(g.first_candidates[part], g.counts[CANDIDATES]):
        if g.candidate_parts[other] != part:
            break
        if g.alive[other] and other != candidate:
            strike(g, other)


@numba.njit(cache=True)
def propagate(kit, patterns, answers, g, field):
    """Rid domains of what cannot be and place what must be, until nothing follows any more."""
    counts, events, dirty = g.counts, g.events, g.dirty
    while True:
        while counts[EVENTS] > 0:
            counts[EVENTS] -= 1
            if not _rid(g, events[counts[EVENTS]]):
                return CONFLICT
        part, forced = 0, -1
        while part < counts[GROWN_PARTS] and forced < 0:
            if dirty[part]:
                forced = _forced(g, part)
                if forced < 0:
                    dirty[part] = False
            part += 1
        if forced < 0:
            return FINE
        outcome = place(kit, patterns, answers, g, field, forced)
        if outcome != FINE:
            return outcome


@numba.njit(cache=True)
def _rid(g, spot):
    """Strike every candidate that has a bad spot; False where a domain is empty then."""
    if g.spot_parts[spot] >= 0:
        return True
    node_parts, node_next, node_counts = g.node_parts, g.node_next, g.node_counts
    alive, member_starts, members = g.alive, g.member_starts, g.members
    node = g.heads[spot]
    while node >= 0:
        if node_counts[node] > 0:
            candidate = g.first_candidates[node_parts[node]]
            while node_counts[node] > 0:
                if alive[candidate] and _has(member_starts, members, candidate, spot) and not strike(g, candidate):
                    return False
                candidate += 1
        node = node_next[node]
    return True


@numba.njit(cache=True)
def _forced(g, part):
    """A spot that all candidates of a part have and where none stands, or -1."""
    candidate, alive, count = g.first_candidates[part], g.alive, g.alive_counts[part]
    heads, node_parts, node_next, node_counts = g.heads, g.node_parts, g.node_next, g.node_counts
    members, spot_parts = g.members, g.spot_parts
    while not alive[candidate]:
        candidate += 1
    for k in range(g.member_starts[candidate], g.member_starts[candidate + 1]):
        spot = members[k]
        if spot_parts[spot] < 0:
            node = find_node(heads, node_parts, node_next, spot, part)
            if node_counts[node] == count:
                return spot
    return -1


@numba.njit(cache=True)
def undo(g, length):
    """Take back everything since the trail was so long."""
    heads, node_parts, node_next, node_counts = g.heads, g.node_parts, g.node_next, g.node_counts
    members, member_starts, bad, spot_parts, counts = g.members, g.member_starts, g.bad, g.spot_parts, g.counts
    counts[EVENTS] = 0
    while counts[TRAIL] > length:
        counts[TRAIL] -= 1
        entry = g.trail[counts[TRAIL]]
        if entry < 0:
            _take_off(g, -1 - entry)
            continue
        part = g.candidate_parts[entry]
        for k in range(member_starts[entry], member_starts[entry + 1]):
            spot = members[k]
            node = find_node(heads, node_parts, node_next, spot, part)
            if node_counts[node] == 0 and spot_parts[spot] < 0:
                bad[spot] -= 1
            node_counts[node] += 1
        g.alive[entry] = True
        g.alive_counts[part] += 1
    for part in range(g.counts[GROWN_PARTS]):
        g.dirty[part] = False


@numba.njit(cache=True)
def _take_off(g, part):
    """Take the newest part off its spot, and its nodes and candidates with it."""
    heads, node_parts, node_next, node_counts = g.heads, g.node_parts, g.node_next, g.node_counts
    bad, spot_parts, counts = g.bad, g.spot_parts, g.counts
    for other in range(counts[SPOTS]):
        node = heads[other]
        if node >= 0 and node_parts[node] == part:
            if node_counts[node] == FORBIDS or (node_counts[node] == 0 and spot_parts[other] < 0):
                bad[other] -= 1
            heads[other] = node_next[node]
            node_next[node] = counts[FREE]
            counts[FREE] = node
    spot = g.part_spots[part]
    g.spot_parts[spot] = -1
    g.have[g.spot_types[spot]] -= 1
    g.counts[CANDIDATES] = g.first_candidates[part]
    g.counts[MEMBERS] = g.member_starts[g.counts[CANDIDATES]] if g.counts[CANDIDATES] > 0 else 0
    g.counts[GROWN_PARTS] = part
