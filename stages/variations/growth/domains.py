"""Domains of placed parts: candidates, kept consistent by propagation. `growth.state` describes the solver's state."""

from __future__ import annotations

import numba
import numpy as np

from stages.shape.geometry.contact_lookup import FORBIDDEN_CONTACT, NO_CONTACT
from stages.shape.geometry.hash_tables import mix
from stages.shape.geometry.pose_kernels import looks_same, squared_distance
from stages.variations.growth.placements import (
    LINK_FORBIDS,
    add_link,
    add_placement,
    boxes_meet,
    find_link,
    find_placement,
    relation,
)
from stages.variations.growth.state import (
    FREE_LINK,
    N_CANDIDATES,
    N_GROWN_PARTS,
    N_MEMBERS,
    N_NEWLY_BLOCKED,
    N_PLACEMENTS,
    TRAIL_LENGTH,
    WORK_DONE,
    placed_part,
    push_placed,
    push_pruned,
)
from stages.variations.kernels.outcomes import Outcome
from stages.variations.kernels.structs import MIN_UPRIGHT_COSINE

LIGHT_CHECKS_PER_WORK = 32
"""Looks at a member of a pattern, or at a placement, that count as one contact asked for."""
MAX_SEED_TURNS = 16
"""Symmetric images of the first part that are tried: round parts have hundreds, all alike."""


@numba.njit(cache=True)
def place(problem, state, placement):
    """Place a part, find its candidates, and prune what it forbids; return OK, CONFLICT or NO_ROOM."""
    part, kit, contacts = state.counts[N_GROWN_PARTS], problem.kit, problem.contacts
    if state.blockers[placement] > 0 or part == problem.field.max_parts:
        return Outcome.CONFLICT
    if state.counts[TRAIL_LENGTH] == len(state.trail):
        return Outcome.NO_ROOM
    push_placed(state, part)
    state.counts[N_GROWN_PARTS] += 1
    state.part_placements[part] = placement
    state.placed_parts[placement] = part
    state.type_counts[state.placement_types[placement]] += 1
    state.domain_sizes[part] = 0
    state.first_candidates[part] = state.counts[N_CANDIDATES]
    counts = state.counts
    counts[WORK_DONE] += counts[N_PLACEMENTS] // LIGHT_CHECKS_PER_WORK
    room, slack = True, 1.1 * kit.limits[1]
    boxes, first_links, link_parts = state.placement_boxes, state.first_links, state.link_parts
    link_counts = state.link_counts
    blockers, placed_parts, newly_blocked = state.blockers, state.placed_parts, state.newly_blocked
    for other in range(counts[N_PLACEMENTS]):
        if other == placement or not boxes_meet(boxes, placement, other, slack):
            continue
        answer = relation(kit, contacts, state, placement, other)
        if answer != NO_CONTACT:
            room = add_link(state, other, part, LINK_FORBIDS if answer == FORBIDDEN_CONTACT else 0) and room
            if answer == FORBIDDEN_CONTACT:
                blockers[other] += 1
                _queue_blocked(blockers, newly_blocked, counts, other)
    room = room and _find_candidates(problem, state, part)
    # A placement that the part touches and has in no candidate is blocked.
    for other in range(counts[N_PLACEMENTS]):
        link = first_links[other]
        if link >= 0 and link_parts[link] == part and link_counts[link] == 0 and placed_parts[other] < 0:
            blockers[other] += 1
            _queue_blocked(blockers, newly_blocked, counts, other)
    state.changed[part] = True
    if not room:
        return Outcome.NO_ROOM
    if state.domain_sizes[part] == 0:
        return Outcome.CONFLICT
    link = state.first_links[placement]
    while link >= 0:
        if state.link_counts[link] != LINK_FORBIDS and not _keep_only_with(state, state.link_parts[link], placement):
            return Outcome.CONFLICT
        link = state.link_next[link]
    return Outcome.OK


@numba.njit(cache=True, inline="always")
def _queue_blocked(blockers, newly_blocked, counts, placement):
    """Queue a placement that has just become blocked; domains are pruned later."""
    if blockers[placement] == 1 and counts[N_NEWLY_BLOCKED] < len(newly_blocked):
        newly_blocked[counts[N_NEWLY_BLOCKED]] = placement
        counts[N_NEWLY_BLOCKED] += 1


@numba.njit(cache=True)
def _find_candidates(problem, state, part):
    """Make the candidates of a part: turned patterns of its type with each part that it touches among their members.

    Returns False where there is no room.
    """
    kit, patterns = problem.kit, problem.patterns
    placement = state.part_placements[part]
    part_type = state.placement_types[placement]
    rotation, translation = state.placement_rotations[placement], state.placement_translations[placement]
    anchor, touching = -1, 0
    link = state.first_links[placement]
    while link >= 0:
        if state.link_counts[link] != LINK_FORBIDS:
            anchor = state.part_placements[state.link_parts[link]]
            touching += 1
        link = state.link_next[link]
    first, last = kit.symmetry_starts[part_type], kit.symmetry_starts[part_type + 1]
    turned, point, relative = np.empty((3, 3)), np.empty(3), np.zeros(3)
    if anchor >= 0:
        for i in range(3):
            for k in range(3):
                relative[i] += rotation[k, i] * (state.placement_translations[anchor, k] - translation[k])
    else:
        last = min(last, first + MAX_SEED_TURNS)
    distance = np.sqrt((relative**2).sum())
    tolerance = kit.limits[0]
    own, end_of_own = patterns.of_type[part_type], patterns.of_type[part_type + 1]
    starts, ups, types, places = patterns.starts, patterns.ups, patterns.types, patterns.translations
    symmetries, anchor_type = kit.symmetries, state.placement_types[max(anchor, 0)]
    state.counts[WORK_DONE] += (last - first) * (starts[end_of_own] - starts[own]) // LIGHT_CHECKS_PER_WORK
    for pattern in range(own, end_of_own):
        start, end = starts[pattern], starts[pattern + 1]
        for symmetry in range(first, last):
            turn = symmetries[symmetry]
            if kit.up >= 0:
                x = 0.0
                for i in range(3):
                    for j in range(3):
                        x += rotation[kit.up, i] * turn[i, j] * ups[pattern, j]
                if x < MIN_UPRIGHT_COSINE:
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
                    fits = looks_same(kit, anchor_type, turned, state.placement_rotations[anchor]) >= 0
            if fits and not _add_candidate(problem, state, part, pattern, turn, touching):
                return False
    return True


@numba.njit(cache=True, inline="always")
def _turn_point(turn, point, out):
    for i in range(3):
        out[i] = turn[i, 0] * point[0] + turn[i, 1] * point[1] + turn[i, 2] * point[2]


@numba.njit(cache=True, inline="always")
def _turn(rotation, turn, other, out):
    """Write the product of three rotations to `out`."""
    for i in range(3):
        for j in range(3):
            x = 0.0
            for k in range(3):
                for m in range(3):
                    x += rotation[i, k] * turn[k, m] * other[m, j]
            out[i, j] = x


@numba.njit(cache=True)
def _add_candidate(problem, state, part, pattern, turn, touching):
    """Add a turned pattern to a part's candidates where all its members may be; return False where there is no room."""
    if state.counts[N_CANDIDATES] + 1 >= len(state.member_starts):
        return False
    kit, patterns, contacts = problem.kit, problem.patterns, problem.contacts
    low, high = problem.field.low, problem.field.high
    placement = state.part_placements[part]
    rotation, translation = state.placement_rotations[placement], state.placement_translations[placement]
    there, turned, place_there = np.empty(3), np.empty((3, 3)), np.empty(3)
    first_links, link_parts, link_next = state.first_links, state.link_parts, state.link_next
    link_counts = state.link_counts
    members = state.members
    types, turns, places = patterns.types, patterns.rotations, patterns.translations
    symmetry_starts, symmetries, boxes, reach = kit.symmetry_starts, kit.symmetries, kit.boxes, kit.reach
    placement_types, placement_rotations = state.placement_types, state.placement_rotations
    placement_translations = state.placement_translations
    buckets, bucket_next, tolerance = state.buckets, state.bucket_next, kit.limits[0]
    start = state.counts[N_MEMBERS]
    end, key, matched = start, np.uint64(0), 0
    for member in range(patterns.starts[pattern], patterns.starts[pattern + 1]):
        if end == len(members):
            return False
        kind = types[member]
        _turn_point(turn, places[member], there)
        _turn_point(rotation, there, place_there)
        place_there += translation
        _turn(rotation, turn, turns[member], turned)
        if not _within(boxes, low, high, kind, turned, place_there):
            return True
        other = find_placement(
            symmetry_starts, symmetries, tolerance, tolerance / reach[kind], placement_types, placement_rotations,
            placement_translations, buckets, bucket_next, kind, turned, place_there,
        )  # fmt: skip
        if other < 0:
            other = add_placement(kit, contacts, state, kind, turned, place_there)
        if other < 0:
            return False
        link = find_link(first_links, link_parts, link_next, other, part)
        if link < 0 or link_counts[link] == LINK_FORBIDS:
            return True
        if state.placed_parts[other] >= 0:
            matched += 1
        elif state.blockers[other] > 0:
            return True
        members[end] = other
        end += 1
        key += mix(np.uint64(other) + np.uint64(1))
    if matched != touching:
        return True
    for known in range(state.first_candidates[part], state.counts[N_CANDIDATES]):
        if state.candidate_keys[known] == key:
            state.weights[known] += patterns.weights[pattern]
            return True
    candidate = state.counts[N_CANDIDATES]
    state.counts[N_CANDIDATES] += 1
    state.counts[N_MEMBERS] = end
    state.member_starts[candidate] = start
    state.member_starts[candidate + 1] = end
    state.candidate_parts[candidate] = part
    state.patterns[candidate] = pattern
    state.weights[candidate] = patterns.weights[pattern]
    state.candidate_keys[candidate] = key
    state.in_domain[candidate] = True
    state.domain_sizes[part] += 1
    for k in range(start, end):
        link_counts[find_link(first_links, link_parts, link_next, members[k], part)] += 1
    return True


@numba.njit(cache=True)
def _within(boxes, low, high, part_type, rotation, translation):
    """Return whether a part at a pose lies between two corners."""
    for i in range(3):
        centre, half = translation[i], 0.0
        for j in range(3):
            centre += rotation[i, j] * boxes[part_type, 0, j]
            half += abs(rotation[i, j]) * boxes[part_type, 1, j]
        if centre - half < low[i] or centre + half > high[i]:
            return False
    return True


@numba.njit(cache=True, inline="always")
def _has(member_starts, members, candidate, placement):
    k, end = member_starts[candidate], member_starts[candidate + 1]
    while k < end and members[k] != placement:
        k += 1
    return k < end


@numba.njit(cache=True)
def _keep_only_with(state, part, placement):
    """Prune the candidates of a part that lack a placement; return False where its domain becomes empty."""
    candidate, count = state.first_candidates[part], state.domain_sizes[part]
    in_domain, member_starts, members = state.in_domain, state.member_starts, state.members
    while count > 0:
        if in_domain[candidate]:
            count -= 1
            if not _has(member_starts, members, candidate, placement) and not prune(state, candidate):
                return False
        candidate += 1
    return True


@numba.njit(cache=True)
def prune(state, candidate):
    """Remove a candidate from its part's domain; return False where the domain becomes empty."""
    part = state.candidate_parts[candidate]
    state.in_domain[candidate] = False
    state.domain_sizes[part] -= 1
    state.changed[part] = True
    push_pruned(state, candidate)
    first_links, link_parts, link_next = state.first_links, state.link_parts, state.link_next
    link_counts = state.link_counts
    members, blockers, placed_parts = state.members, state.blockers, state.placed_parts
    newly_blocked, counts = state.newly_blocked, state.counts
    for k in range(state.member_starts[candidate], state.member_starts[candidate + 1]):
        placement = members[k]
        link = find_link(first_links, link_parts, link_next, placement, part)
        link_counts[link] -= 1
        if link_counts[link] == 0 and placed_parts[placement] < 0:
            blockers[placement] += 1
            _queue_blocked(blockers, newly_blocked, counts, placement)
    return state.domain_sizes[part] > 0


@numba.njit(cache=True)
def assign(state, candidate):
    """Make a candidate the only one of its part."""
    part = state.candidate_parts[candidate]
    for other in range(state.first_candidates[part], state.counts[N_CANDIDATES]):
        if state.candidate_parts[other] != part:
            break
        if state.in_domain[other] and other != candidate:
            prune(state, other)


@numba.njit(cache=True)
def propagate(problem, state):
    """Prune what cannot be and place what must be, until nothing follows; return OK, CONFLICT or NO_ROOM."""
    counts, newly_blocked, dirty = state.counts, state.newly_blocked, state.changed
    while True:
        while counts[N_NEWLY_BLOCKED] > 0:
            counts[N_NEWLY_BLOCKED] -= 1
            if not _prune_all_with(state, newly_blocked[counts[N_NEWLY_BLOCKED]]):
                return Outcome.CONFLICT
        part, forced = np.int64(0), -1
        while part < counts[N_GROWN_PARTS] and forced < 0:
            if dirty[part]:
                forced = _forced(state, part)
                if forced < 0:
                    dirty[part] = False
            part += 1
        if forced < 0:
            return Outcome.OK
        outcome = place(problem, state, forced)
        if outcome != Outcome.OK:
            return outcome


@numba.njit(cache=True)
def _prune_all_with(state, placement):
    """Prune every candidate that has a blocked placement; return False where a domain becomes empty."""
    if state.placed_parts[placement] >= 0:
        return True
    link_parts, link_next, link_counts = state.link_parts, state.link_next, state.link_counts
    in_domain, member_starts, members = state.in_domain, state.member_starts, state.members
    link = state.first_links[placement]
    while link >= 0:
        if link_counts[link] > 0:
            candidate = state.first_candidates[link_parts[link]]
            while link_counts[link] > 0:
                if (
                    in_domain[candidate]
                    and _has(member_starts, members, candidate, placement)
                    and not prune(state, candidate)
                ):
                    return False
                candidate += 1
        link = link_next[link]
    return True


@numba.njit(cache=True)
def _forced(state, part):
    """Return a placement that all candidates of a part have and where no part is placed, or -1."""
    candidate, in_domain, count = state.first_candidates[part], state.in_domain, state.domain_sizes[part]
    first_links, link_parts, link_next = state.first_links, state.link_parts, state.link_next
    link_counts = state.link_counts
    members, placed_parts = state.members, state.placed_parts
    while not in_domain[candidate]:
        candidate += 1
    for k in range(state.member_starts[candidate], state.member_starts[candidate + 1]):
        placement = members[k]
        if placed_parts[placement] < 0:
            link = find_link(first_links, link_parts, link_next, placement, part)
            if link_counts[link] == count:
                return placement
    return -1


@numba.njit(cache=True)
def undo(state, length):
    """Undo everything since the trail had that length."""
    first_links, link_parts, link_next = state.first_links, state.link_parts, state.link_next
    link_counts = state.link_counts
    members, member_starts, blockers = state.members, state.member_starts, state.blockers
    placed_parts, counts = state.placed_parts, state.counts
    counts[N_NEWLY_BLOCKED] = 0
    while counts[TRAIL_LENGTH] > length:
        counts[TRAIL_LENGTH] -= 1
        entry = state.trail[counts[TRAIL_LENGTH]]
        if placed_part(entry) >= 0:
            _take_off(state, placed_part(entry))
            continue
        part = state.candidate_parts[entry]
        for k in range(member_starts[entry], member_starts[entry + 1]):
            placement = members[k]
            link = find_link(first_links, link_parts, link_next, placement, part)
            if link_counts[link] == 0 and placed_parts[placement] < 0:
                blockers[placement] -= 1
            link_counts[link] += 1
        state.in_domain[entry] = True
        state.domain_sizes[part] += 1
    for part in range(state.counts[N_GROWN_PARTS]):
        state.changed[part] = False


@numba.njit(cache=True)
def _take_off(state, part):
    """Remove the newest part from its placement, with its links and candidates."""
    first_links, link_parts, link_next = state.first_links, state.link_parts, state.link_next
    link_counts = state.link_counts
    blockers, placed_parts, counts = state.blockers, state.placed_parts, state.counts
    for other in range(counts[N_PLACEMENTS]):
        link = first_links[other]
        if link >= 0 and link_parts[link] == part:
            if link_counts[link] == LINK_FORBIDS or (link_counts[link] == 0 and placed_parts[other] < 0):
                blockers[other] -= 1
            first_links[other] = link_next[link]
            link_next[link] = counts[FREE_LINK]
            counts[FREE_LINK] = link
    placement = state.part_placements[part]
    state.placed_parts[placement] = -1
    state.type_counts[state.placement_types[placement]] -= 1
    state.counts[N_CANDIDATES] = state.first_candidates[part]
    state.counts[N_MEMBERS] = state.member_starts[state.counts[N_CANDIDATES]] if state.counts[N_CANDIDATES] > 0 else 0
    state.counts[N_GROWN_PARTS] = part
