"""Growing one shape: the most constrained part first, whole patterns at once, back-tracking along a trail."""

from __future__ import annotations

import numba
import numpy as np

from stages.shape.geometry.contact_lookup import random_below
from stages.variations.growth.domains import FINE, NO_ROOM, narrow, place, propagate, strike, undo
from stages.variations.growth.placements import add_spot
from stages.variations.growth.state import CONFLICTS, DECISIONS, FREE, GROWN_PARTS, TRAIL
from stages.variations.kernels.checks import find_contacts
from stages.variations.kernels.structs import EDGES, PARTS, TRY
from stages.variations.kernels.variant_graph import place_boxes

CONFLICTS_ALLOWED = 120
"""After so many conflicts a shape is given up."""
JUMP_EVERY, JUMP_MOST = 8, 16
"""Every so manieth conflict takes back more than one decision, at most so many."""
CLOSING = -2.0
"""What a new part costs from the target size on, as an exponent."""


@numba.njit(cache=True)
def grow(rng, kit, patterns, answers, g, field):
    """Grow a shape from its first part until every part has a whole pattern around it; False where that is given up."""
    g.counts[:] = 0
    g.counts[FREE] = -1
    g.buckets[:] = -1
    g.have[:] = 0
    seed = add_spot(kit, answers, g, field.seed_type, field.rotation, field.translation)
    outcome = place(kit, patterns, answers, g, field, seed)
    if outcome == FINE:
        outcome = propagate(kit, patterns, answers, g, field)
    while True:
        if outcome == NO_ROOM:
            return False
        if outcome == FINE:
            part = _most_constrained(g)
            if part < 0:
                return True
            choice = _draw(rng, patterns, g, field, part)
            if g.counts[DECISIONS] == len(g.decisions):
                return False
            g.decisions[g.counts[DECISIONS], 0] = g.counts[TRAIL]
            g.decisions[g.counts[DECISIONS], 1] = choice
            g.counts[DECISIONS] += 1
            narrow(g, choice)
        else:
            g.counts[CONFLICTS] += 1
            back = 1
            if g.counts[CONFLICTS] % JUMP_EVERY == 0:
                back += random_below(rng, JUMP_MOST)
            if g.counts[CONFLICTS] == CONFLICTS_ALLOWED or g.counts[DECISIONS] < back:
                return False
            g.counts[DECISIONS] -= back
            undo(g, g.decisions[g.counts[DECISIONS], 0])
            if not strike(g, g.decisions[g.counts[DECISIONS], 1]):
                continue
        outcome = propagate(kit, patterns, answers, g, field)


@numba.njit(cache=True)
def _most_constrained(g):
    """The part with the fewest candidates of those that have several, the oldest of equals; -1 where there is none."""
    best, fewest, alive_counts = -1, 1 << 30, g.alive_counts
    for part in range(g.counts[GROWN_PARTS]):
        if 1 < alive_counts[part] < fewest:
            best, fewest = part, alive_counts[part]
    return best


@numba.njit(cache=True)
def _draw(rng, patterns, g, field, part):
    """One of a part's candidates: oftener those seen oftener, those that bring types the shape lacks beside the
    exemplars, and, from the target size on, those that bring few parts."""
    candidate, alive = g.first_candidates[part], g.alive_counts[part]
    living, starts, members, shares, have = g.alive, g.member_starts, g.members, patterns.shares, g.have
    spot_parts, spot_types, weights = g.spot_parts, g.spot_types, g.weights
    chances = np.empty(alive)
    chosen = np.empty(alive, dtype=np.int64)
    total, found, parts = 0.0, 0, g.counts[GROWN_PARTS]
    while found < alive:
        if living[candidate]:
            fresh, style = 0, 0.0
            for k in range(starts[candidate], starts[candidate + 1]):
                spot = members[k]
                if spot_parts[spot] < 0:
                    kind = spot_types[spot]
                    fresh += 1
                    style += np.log((shares[kind] + 0.01) / ((have[kind] + 1.0) / (parts + 1.0) + 0.01))
            chance = np.log(weights[candidate])
            if fresh > 0:
                chance += style / fresh
            if parts >= field.target:
                chance += CLOSING * fresh
            chances[found] = chance
            chosen[found] = candidate
            found += 1
        candidate += 1
    most = chances.max()
    for k in range(alive):
        chances[k] = np.exp(max(chances[k] - most, -30.0))
        total += chances[k]
    at = rng.random() * total
    for k in range(alive):
        at -= chances[k]
        if at <= 0.0:
            return chosen[k]
    return chosen[alive - 1]


@numba.njit(cache=True)
def take_over(kit, patterns, answers, g, ws):
    """Put the grown shape into the workspace of a try, with its edges; the outcome of `find_contacts`."""
    ws.counts[TRY] += 1
    ws.counts[EDGES] = 0
    parts = g.counts[GROWN_PARTS]
    ws.counts[PARTS] = parts
    for part in range(parts):
        spot = g.part_spots[part]
        ws.types[part] = g.spot_types[spot]
        candidate = g.first_candidates[part]
        while not g.alive[candidate]:
            candidate += 1
        ws.origin[part] = patterns.owners[g.patterns[candidate]]
        for i in range(3):
            ws.translations[part, i] = g.spot_translations[spot, i]
            for j in range(3):
                ws.rotations[part, i, j] = g.spot_rotations[spot, i, j]
    place_boxes(kit.boxes, ws.types, ws.rotations, ws.translations, parts, ws.boxes)
    return find_contacts(kit, answers, ws)
