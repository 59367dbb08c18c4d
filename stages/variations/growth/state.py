"""State of the growth solver: a shape is grown part by part, by constraint propagation and backtracking.

placement   a place where a part of a type may be, modulo the part's symmetries
variable    a placed part; its value is what surrounds it
value       a candidate: a pattern (all neighbours of a part, with poses) turned by one of the part's symmetries, given
    as
    the placements of its members
domain      candidates first_candidates[part] and following with in_domain set; domain_sizes[part] of them
link        joins a placement with a placed part: the part forbids the placement, or touches it, and then counts its
    candidates that have it
blocked     a placement with blockers > 0: a part forbids it, or touches it and has it in no candidate
trail       what to undo, newest last: a pruned candidate or a placed part, see `push_placed`
invariant   after `undo(state, length)` everything but `newly_blocked` is as it was when the trail had that length
outcomes    `grow` returns True for a shape whose parts all have one candidate left; False where it is given up: too
many
    conflicts, no decision left to undo, or NO_ROOM in an array
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np

from stages.variations.kernels.structs import KitTables

(
    N_PLACEMENTS,
    N_LINKS,
    FREE_LINK,
    N_GROWN_PARTS,
    N_CANDIDATES,
    N_MEMBERS,
    TRAIL_LENGTH,
    N_NEWLY_BLOCKED,
    WORK_DONE,
    N_DECISIONS,
    N_CONFLICTS,
) = range(11)
"""Indices of `GrowthState.counts`. FREE_LINK is the first free link, or -1; WORK_DONE counts contacts asked for."""


class PatternTables(NamedTuple):
    """The patterns of a kit, ordered by type."""

    of_type: np.ndarray  # int64 (types + 1,): first pattern of each type
    starts: np.ndarray  # int64 (k,): first member of each pattern
    weights: np.ndarray  # float64 (k,): how often each was seen
    owners: np.ndarray  # int64 (k,): the exemplar that showed it first
    ups: np.ndarray  # float64 (k, 3): direction of up in coordinates of the part
    types: np.ndarray  # int64 (m,): types of the members
    rotations: np.ndarray  # float64 (m, 3, 3): in coordinates of the part
    translations: np.ndarray  # float64 (m, 3)
    shares: np.ndarray  # float64 (types,): share of the exemplars' parts


class KnownContacts(NamedTuple):
    """Known contacts and where to ask for others."""

    keys: np.ndarray  # of a `ContactTable`
    values: np.ndarray
    oracle_address: int  # of a C function of two placements, `ContactOracle.c_callback`


class GrowthField(NamedTuple):
    """What one shape is to be: its first part and its limits."""

    seed_type: int
    rotation: np.ndarray  # float64 (3, 3): of the first part
    translation: np.ndarray  # float64 (3,)
    low: np.ndarray  # float64 (3,): corners between which every part must be
    high: np.ndarray  # float64 (3,)
    target: int  # number of parts from which the shape is brought to an end
    max_parts: int


class GrowthProblem(NamedTuple):
    """What does not change while a shape grows."""

    kit: KitTables
    patterns: PatternTables
    contacts: KnownContacts
    field: GrowthField


class GrowthState(NamedTuple):
    """The shape that is being grown and what its parts may become, for s placements, p parts, c candidates."""

    placement_types: np.ndarray  # int64 (s,)
    placement_rotations: np.ndarray  # float64 (s, 3, 3)
    placement_translations: np.ndarray  # float64 (s, 3)
    placement_boxes: np.ndarray  # float64 (s, 2, 3): centre and half extents
    placed_parts: np.ndarray  # int64 (s,): the part placed there, or -1
    blockers: np.ndarray  # int64 (s,): number of parts that block it
    first_links: np.ndarray  # int64 (s,): its newest link, or -1
    bucket_next: np.ndarray  # int64 (s,): the next placement of its bucket, or -1
    buckets: np.ndarray  # int64 (b,): first placement of each bucket by position, or -1
    link_placements: np.ndarray  # int64 (n,)
    link_parts: np.ndarray  # int64 (n,)
    link_counts: np.ndarray  # int64 (n,): candidates of the part's domain with the placement, or FORBIDS
    link_next: np.ndarray  # int64 (n,): the next link of the placement, or of the free ones
    part_placements: np.ndarray  # int64 (p,)
    first_candidates: np.ndarray  # int64 (p + 1,)
    domain_sizes: np.ndarray  # int64 (p,)
    changed: np.ndarray  # bool (p,): its domain has shrunk since it was propagated
    in_domain: np.ndarray  # bool (c,)
    candidate_parts: np.ndarray  # int64 (c,)
    patterns: np.ndarray  # int64 (c,)
    weights: np.ndarray  # float64 (c,)
    candidate_keys: np.ndarray  # uint64 (c,)
    member_starts: np.ndarray  # int64 (c + 1,)
    members: np.ndarray  # int64 (m,): placements
    trail: np.ndarray  # int64 (t,): see `push_placed`
    newly_blocked: np.ndarray  # int64 (e,): placements whose blocking is not propagated yet
    decisions: np.ndarray  # int64 (d, 2): length of the trail before, candidate chosen
    type_counts: np.ndarray  # int64 (types,): parts of each type
    counts: np.ndarray  # int64 (11,)


@numba.njit(cache=True, inline="always")
def push_pruned(state, candidate):
    """Record on the trail that a candidate was pruned."""
    state.trail[state.counts[TRAIL_LENGTH]] = candidate
    state.counts[TRAIL_LENGTH] += 1


@numba.njit(cache=True, inline="always")
def push_placed(state, part):
    """Record on the trail that a part was placed."""
    state.trail[state.counts[TRAIL_LENGTH]] = -1 - part
    state.counts[TRAIL_LENGTH] += 1


@numba.njit(cache=True, inline="always")
def placed_part(entry):
    """Return the part of a trail entry, negative where the entry is a pruned candidate."""
    return -1 - entry


def new_growth_state(types: int, max_parts: int) -> GrowthState:
    """Return room for a shape of at most `max_parts` parts of a kit with `types` types."""
    placements, candidates = 4096 + 256 * max_parts, 4096 + 64 * max_parts
    return GrowthState(
        placement_types=np.zeros(placements, dtype=np.int64),
        placement_rotations=np.zeros((placements, 3, 3)),
        placement_translations=np.zeros((placements, 3)),
        placement_boxes=np.zeros((placements, 2, 3)),
        placed_parts=np.full(placements, -1, dtype=np.int64),
        blockers=np.zeros(placements, dtype=np.int64),
        first_links=np.full(placements, -1, dtype=np.int64),
        bucket_next=np.full(placements, -1, dtype=np.int64),
        buckets=np.full(1 << 16, -1, dtype=np.int64),
        link_placements=np.zeros(16 * placements, dtype=np.int64),
        link_parts=np.zeros(16 * placements, dtype=np.int64),
        link_counts=np.zeros(16 * placements, dtype=np.int64),
        link_next=np.zeros(16 * placements, dtype=np.int64),
        part_placements=np.zeros(max_parts, dtype=np.int64),
        first_candidates=np.zeros(max_parts + 1, dtype=np.int64),
        domain_sizes=np.zeros(max_parts, dtype=np.int64),
        changed=np.zeros(max_parts, dtype=np.bool_),
        in_domain=np.zeros(candidates, dtype=np.bool_),
        candidate_parts=np.zeros(candidates, dtype=np.int64),
        patterns=np.zeros(candidates, dtype=np.int64),
        weights=np.zeros(candidates),
        candidate_keys=np.zeros(candidates, dtype=np.uint64),
        member_starts=np.zeros(candidates + 1, dtype=np.int64),
        members=np.zeros(16 * candidates, dtype=np.int64),
        trail=np.zeros(candidates + 2 * max_parts, dtype=np.int64),
        newly_blocked=np.zeros(16 * placements, dtype=np.int64),
        decisions=np.zeros((candidates, 2), dtype=np.int64),
        type_counts=np.zeros(types, dtype=np.int64),
        counts=np.zeros(11, dtype=np.int64),
    )
