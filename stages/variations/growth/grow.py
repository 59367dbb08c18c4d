"""Growing one shape: the most constrained part first, whole patterns at once, backtracking along a trail.

Example: a part P has the candidates {A, B}, {A, C}. `propagate` places A, which both have. `_draw` chooses {A, B},
which is a decision; `assign` prunes {A, C} and `propagate` places B. If B's domain is empty that is a CONFLICT: `undo`
takes B off and restores {A, C}, `prune` removes {A, B}, and `propagate` places C.
"""

from __future__ import annotations

import numba
import numpy as np

from stages.variations.growth.domains import assign, place, propagate, prune, undo
from stages.variations.growth.placements import add_placement
from stages.variations.growth.state import FREE_LINK, N_CONFLICTS, N_DECISIONS, N_GROWN_PARTS, TRAIL_LENGTH
from stages.variations.kernels.checks import find_contacts
from stages.variations.kernels.outcomes import Outcome
from stages.variations.kernels.random_choice import random_below
from stages.variations.kernels.structs import N_EDGES, N_PARTS, TRY_NUMBER
from stages.variations.kernels.variant_graph import place_boxes

MAX_CONFLICTS = 120
"""Conflicts after which a shape is given up."""
CONFLICTS_PER_JUMP, MAX_JUMP = 8, 16
"""After every CONFLICTS_PER_JUMP conflicts up to MAX_JUMP more decisions are undone."""
LOG_COST_BEYOND_TARGET = -2.0
"""What a new part adds to the logarithm of a candidate's chance from the target size on."""


@numba.njit(cache=True)
def grow(rng, problem, state):
    """Grow a shape from its first part until every part has a whole pattern around it; return False where it is given
    up.
    """
    state.counts[:] = 0
    state.counts[FREE_LINK] = -1
    state.buckets[:] = -1
    state.type_counts[:] = 0
    field = problem.field
    seed = add_placement(problem.kit, problem.contacts, state, field.seed_type, field.rotation, field.translation)
    outcome = place(problem, state, seed)
    if outcome == Outcome.OK:
        outcome = propagate(problem, state)
    while True:
        if outcome == Outcome.NO_ROOM:
            return False
        if outcome == Outcome.OK:
            part = _most_constrained(state)
            if part < 0:
                return True
            choice = _draw(rng, problem, state, part)
            if state.counts[N_DECISIONS] == len(state.decisions):
                return False
            state.decisions[state.counts[N_DECISIONS], 0] = state.counts[TRAIL_LENGTH]
            state.decisions[state.counts[N_DECISIONS], 1] = choice
            state.counts[N_DECISIONS] += 1
            assign(state, choice)
        else:
            state.counts[N_CONFLICTS] += 1
            back = 1
            if state.counts[N_CONFLICTS] % CONFLICTS_PER_JUMP == 0:
                back += random_below(rng, MAX_JUMP)
            if state.counts[N_CONFLICTS] == MAX_CONFLICTS or state.counts[N_DECISIONS] < back:
                return False
            state.counts[N_DECISIONS] -= back
            undo(state, state.decisions[state.counts[N_DECISIONS], 0])
            if not prune(state, state.decisions[state.counts[N_DECISIONS], 1]):
                continue
        outcome = propagate(problem, state)


@numba.njit(cache=True)
def _most_constrained(state):
    """Return the part with the fewest candidates, at least two, the oldest of equals; or -1."""
    best, smallest, sizes = -1, 1 << 30, state.domain_sizes
    for part in range(state.counts[N_GROWN_PARTS]):
        if 1 < sizes[part] < smallest:
            best, smallest = part, sizes[part]
    return best


@numba.njit(cache=True)
def _draw(rng, problem, state, part):
    """Draw one of a part's candidates.

    Likelier are those seen more often, those with types that the shape lacks compared with the exemplars and, from the
    target size on, those that add few parts.
    """
    candidate, domain_size = state.first_candidates[part], state.domain_sizes[part]
    in_domain, starts, members, type_counts = state.in_domain, state.member_starts, state.members, state.type_counts
    shares, target = problem.patterns.shares, problem.field.target
    placed_parts, placement_types, weights = state.placed_parts, state.placement_types, state.weights
    chances = np.empty(domain_size)
    chosen = np.empty(domain_size, dtype=np.int64)
    total, filled, parts = 0.0, 0, state.counts[N_GROWN_PARTS]
    while filled < domain_size:
        if in_domain[candidate]:
            new_parts, style = 0, 0.0
            for k in range(starts[candidate], starts[candidate + 1]):
                placement = members[k]
                if placed_parts[placement] < 0:
                    kind = placement_types[placement]
                    new_parts += 1
                    style += np.log((shares[kind] + 0.01) / ((type_counts[kind] + 1.0) / (parts + 1.0) + 0.01))
            chance = np.log(weights[candidate])
            if new_parts > 0:
                chance += style / new_parts
            if parts >= target:
                chance += LOG_COST_BEYOND_TARGET * new_parts
            chances[filled] = chance
            chosen[filled] = candidate
            filled += 1
        candidate += 1
    most = chances.max()
    for k in range(domain_size):
        chances[k] = np.exp(max(chances[k] - most, -30.0))
        total += chances[k]
    at = rng.random() * total
    for k in range(domain_size):
        at -= chances[k]
        if at <= 0.0:
            return chosen[k]
    return chosen[domain_size - 1]


@numba.njit(cache=True)
def take_over(kit, patterns, contacts, state, ws):
    """Write the grown shape, with its edges, to the workspace; return the outcome of `find_contacts`."""
    ws.counts[TRY_NUMBER] += 1
    ws.counts[N_EDGES] = 0
    parts = state.counts[N_GROWN_PARTS]
    ws.counts[N_PARTS] = parts
    for part in range(parts):
        placement = state.part_placements[part]
        ws.types[part] = state.placement_types[placement]
        candidate = state.first_candidates[part]
        while not state.in_domain[candidate]:
            candidate += 1
        ws.origin[part] = patterns.owners[state.patterns[candidate]]
        for i in range(3):
            ws.translations[part, i] = state.placement_translations[placement, i]
            for j in range(3):
                ws.rotations[part, i, j] = state.placement_rotations[placement, i, j]
    place_boxes(kit.boxes, ws.types, ws.rotations, ws.translations, parts, ws.boxes)
    return find_contacts(kit, contacts, ws)
