"""What the kernels of growth work on: the patterns of a kit, and the shape that is being grown.

A *pattern* is all that stands around a part: its neighbours with their poses in its coordinates. A *spot* is a place
where a part of a type may stand, modulo the part's symmetries. A *candidate* of a part is a pattern turned by one of
the part's symmetries, as the spots of its members; the candidates that are still alive are the part's domain.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

SPOTS, NODES, FREE, GROWN_PARTS, CANDIDATES, MEMBERS, TRAIL, EVENTS, WORK, DECISIONS, CONFLICTS = range(11)
"""Places in `Growing.counts`: numbers of spots, nodes, parts, candidates, members of candidates, entries of the trail,
spots that wait to be struck from domains, work in contacts asked for, decisions and conflicts; FREE is the first free
node, or -1."""


class PatternTables(NamedTuple):
    """The patterns of a kit, those of one type beside each other.

    of_type int64 (types + 1,), starts int64 (k + 1,): where those of a type, and the members of each, begin;
    weights float64 (k,): how often each was seen; owners int64 (k,): the exemplar that showed it first;
    ups float64 (k, 3): which way was up, in coordinates of the part; types int64 (m,), rotations float64 (m, 3, 3),
    translations float64 (m, 3): the members, in coordinates of the part; shares float64 (types,): of the exemplars'
    parts.
    """

    of_type: np.ndarray
    starts: np.ndarray
    weights: np.ndarray
    owners: np.ndarray
    ups: np.ndarray
    types: np.ndarray
    rotations: np.ndarray
    translations: np.ndarray
    shares: np.ndarray


class KnownContacts(NamedTuple):
    """Known contact answers, `keys` and `values` of an `Answers`, and whom to ask for others: the address of a C
    function of two spots (`ContactOracle.asker`)."""

    keys: np.ndarray
    values: np.ndarray
    oracle_address: int


class GrowthField(NamedTuple):
    """What one shape is to be: a part of `seed_type` stands at `rotation` (3, 3) and `translation` (3,); every part
    lies within `low` and `high`, both (3,); from `target` parts on it is brought to an end, more than `most` it must
    not have."""

    seed_type: int
    rotation: np.ndarray
    translation: np.ndarray
    low: np.ndarray
    high: np.ndarray
    target: int
    most: int


class Growing(NamedTuple):
    """The shape in hand, and all that its parts may come to be.

    A *node* joins a spot with a part that stands: the part forbids the spot, or touches it, in which case the node
    counts the living candidates of the part that have the spot. A spot is bad while a part forbids it or touches it
    and has it in no living candidate.
    """

    spot_types: np.ndarray  # int64 (s,)
    spot_rotations: np.ndarray  # float64 (s, 3, 3)
    spot_translations: np.ndarray  # float64 (s, 3)
    spot_boxes: np.ndarray  # float64 (s, 2, 3): centre and half extents
    spot_parts: np.ndarray  # int64 (s,): the part that stands there, or -1
    bad: np.ndarray  # int64 (s,): how many parts are against it
    heads: np.ndarray  # int64 (s,): its newest node, or -1
    chains: np.ndarray  # int64 (s,): the next spot of its bucket, or -1
    buckets: np.ndarray  # int64 (b,): first spot of each bucket by position, or -1
    node_spots: np.ndarray  # int64 (n,)
    node_parts: np.ndarray  # int64 (n,)
    node_counts: np.ndarray  # int64 (n,): living candidates, or FORBIDS
    node_next: np.ndarray  # int64 (n,)
    part_spots: np.ndarray  # int64 (p,)
    first_candidates: np.ndarray  # int64 (p + 1,)
    alive_counts: np.ndarray  # int64 (p,)
    dirty: np.ndarray  # bool (p,): its domain has shrunk
    alive: np.ndarray  # bool (c,)
    candidate_parts: np.ndarray  # int64 (c,)
    patterns: np.ndarray  # int64 (c,)
    weights: np.ndarray  # float64 (c,)
    hashes: np.ndarray  # uint64 (c,)
    member_starts: np.ndarray  # int64 (c + 1,)
    members: np.ndarray  # int64 (m,): spots
    trail: np.ndarray  # int64 (t,): candidates struck, or -1 - part for parts placed
    events: np.ndarray  # int64 (e,): spots gone bad
    decisions: np.ndarray  # int64 (d, 2): length of the trail before, candidate chosen
    have: np.ndarray  # int64 (types,): parts of each type
    counts: np.ndarray  # int64 (11,)


def growing(types: int, most: int) -> Growing:
    """Room for a shape of at most `most` parts of a kit with so many types."""
    spots, candidates = 4096 + 256 * most, 4096 + 64 * most
    return Growing(
        spot_types=np.zeros(spots, dtype=np.int64),
        spot_rotations=np.zeros((spots, 3, 3)),
        spot_translations=np.zeros((spots, 3)),
        spot_boxes=np.zeros((spots, 2, 3)),
        spot_parts=np.full(spots, -1, dtype=np.int64),
        bad=np.zeros(spots, dtype=np.int64),
        heads=np.full(spots, -1, dtype=np.int64),
        chains=np.full(spots, -1, dtype=np.int64),
        buckets=np.full(1 << 16, -1, dtype=np.int64),
        node_spots=np.zeros(16 * spots, dtype=np.int64),
        node_parts=np.zeros(16 * spots, dtype=np.int64),
        node_counts=np.zeros(16 * spots, dtype=np.int64),
        node_next=np.zeros(16 * spots, dtype=np.int64),
        part_spots=np.zeros(most, dtype=np.int64),
        first_candidates=np.zeros(most + 1, dtype=np.int64),
        alive_counts=np.zeros(most, dtype=np.int64),
        dirty=np.zeros(most, dtype=np.bool_),
        alive=np.zeros(candidates, dtype=np.bool_),
        candidate_parts=np.zeros(candidates, dtype=np.int64),
        patterns=np.zeros(candidates, dtype=np.int64),
        weights=np.zeros(candidates),
        hashes=np.zeros(candidates, dtype=np.uint64),
        member_starts=np.zeros(candidates + 1, dtype=np.int64),
        members=np.zeros(16 * candidates, dtype=np.int64),
        trail=np.zeros(candidates + 2 * most, dtype=np.int64),
        events=np.zeros(16 * spots, dtype=np.int64),
        decisions=np.zeros((candidates, 2), dtype=np.int64),
        have=np.zeros(types, dtype=np.int64),
        counts=np.zeros(11, dtype=np.int64),
    )
