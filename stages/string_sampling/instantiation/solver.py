"""Instantiates a graph: backtracking search with forward checking over the placements of its parts (strings §6).

variable   a node of the graph
value      a placement of a node: an oriented part type with a pose, a row of `types` to `in_domain` in SolverState
domain     the rows domain_start[node] to domain_end[node]; domain_size[node] of them are `in_domain`; it exists once a
           neighbour is placed
assigned   assigned[node] is the value of a placed node, or -1
trail      what to undo, newest last: PRUNED value, PLACED node, OPENED domain of a node; encoded by the push functions
invariant  after `_undo` to a length of the trail, domains, assignments and neighbour counts are as they were then
restarts   after a number of conflicts per node, which grows by each restart; weights of nodes remember conflicts
outcomes   SOLVED; IMPOSSIBLE, the search space is exhausted; BUDGET, the placements are used up; NO_ROOM, an array is
           full. Steps end with OK, CONFLICT or NO_ROOM.

A walk-through of a row A-B-C: `_attempt` opens the domain of A, and places A at a value. `_place` pushes PLACED A,
prunes the values of open domains against it, and opens the domain of B (OPENED B) with the placements next to A that
contradict no placed part. B is placed; no placement of C is left: a conflict. `_undo` pops OPENED C, PLACED B and
what B pruned; the value of B is pruned, and the next one is tried.

Numba compiles this module when it is imported: import it inside functions.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np

from stages.shape.geometry.contact_lookup import NO_CONTACT, UNKNOWN_CONTACT, call_oracle, contact_key, quantize_pose
from stages.shape.geometry.hash_tables import look_up
from stages.shape.geometry.pose_kernels import compose, relative_transform
from stages.shape.graphs.grammar_patterns import fits
from stages.string_sampling.instantiation.guidance import Guide, drop_frames, propagate_frames, score_by_category
from stages.string_sampling.instantiation.placements import DockedPlacements
from stages.string_sampling.instantiation.reach import MAX_CHAIN_LENGTH, ChainReach, can_reach
from stages.string_sampling.instantiation.state import (
    N_CONFLICTS,
    N_PLACED,
    N_PLACEMENTS,
    N_VALUES,
    TRAIL_LENGTH,
    GraphTables,
    SolverMethod,
)
from stages.variations.growth.state import KnownContacts
from stages.variations.kernels.outcomes import Outcome
from stages.variations.kernels.structs import KitTables

NO_NODE = -1
CONFLICTS_PER_NODE, RESTART_GROWTH = 4.0, 1.5
"""Conflicts per node before a restart, and their growth at each restart."""
LEAF_PENALTY = 1e6
"""Added to domain sizes off all cycles, so that cycles come first."""


class Problem(NamedTuple):
    """What never changes during a search."""

    kit: KitTables
    placements: DockedPlacements
    contacts: KnownContacts
    graph: GraphTables
    guide: Guide
    method: SolverMethod
    reach: ChainReach


@numba.njit(cache=True)
def solve(rng, problem, s):
    """Place every node so that edges are contacts and nothing else touches. The placements are in `s.assigned`."""
    s.counts[N_PLACEMENTS] = 0
    s.weights[: len(problem.graph.labels)] = 1.0
    max_conflicts = CONFLICTS_PER_NODE * len(problem.graph.labels)
    while True:
        outcome = _attempt(rng, problem, s, np.int64(max_conflicts))
        if outcome != Outcome.CONFLICT:
            return outcome
        max_conflicts *= RESTART_GROWTH


@numba.njit(cache=True)
def _attempt(rng, problem, s, max_conflicts):
    """Search from one start. CONFLICT for a restart."""
    graph, guide, method = problem.graph, problem.guide, problem.method
    n = len(graph.labels)
    s.counts[N_VALUES] = 0
    s.counts[N_PLACED] = 0
    s.counts[TRAIL_LENGTH] = 0
    s.counts[N_CONFLICTS] = 0
    s.domain_start[:n] = -1
    s.assigned[:n] = -1
    s.neighbours[:n] = 0
    s.touches[:n] = False
    s.framed[:n] = False
    depth = 0
    if not _open_root(problem, s, _root(rng, problem, s)):
        return Outcome.NO_ROOM
    outcome = Outcome.OK
    while True:
        if outcome == Outcome.OK:
            if s.counts[N_PLACED] == n:
                if method.whole or not method.checked or not method.ended or _all_complete(problem, s):
                    return Outcome.SOLVED
                outcome = Outcome.CONFLICT
                continue
            outcome, node = _next(rng, problem, s)
            if outcome == Outcome.NO_ROOM:
                return Outcome.NO_ROOM
            if outcome == Outcome.CONFLICT:
                continue
            if method.checked and not method.whole:
                _score_by_contacts(problem, s, node)
                if s.domain_size[node] == 0:
                    s.weights[node] += 1.0
                    outcome = Outcome.CONFLICT
                    continue
            if len(guide.parents) > 0:
                score_by_category(problem.kit, guide, graph, s, node)
            if s.counts[N_PLACEMENTS] == method.budget:
                return Outcome.BUDGET
            s.counts[N_PLACEMENTS] += 1
            value = _choose(rng, s, node)
            s.decisions[depth, 0] = s.counts[TRAIL_LENGTH]
            s.decisions[depth, 1] = value
            depth += 1
            outcome = _place(problem, s, value)
            if len(guide.parents) > 0:
                propagate_frames(problem.kit, guide, graph, s, value)
            if outcome == Outcome.NO_ROOM:
                return Outcome.NO_ROOM
        else:
            s.counts[N_CONFLICTS] += 1
            if depth == 0:
                return Outcome.IMPOSSIBLE if method.checked and method.constrained else Outcome.CONFLICT
            if not method.backtracks or s.counts[N_CONFLICTS] > max_conflicts:
                return Outcome.CONFLICT
            depth -= 1
            _undo(graph, s, s.decisions[depth, 0])
            drop_frames(guide, s)
            value = s.decisions[depth, 1]
            _prune(s, value)
            outcome = Outcome.OK
            if s.domain_size[s.nodes[value]] == 0:
                s.weights[s.nodes[value]] += 1.0
                outcome = Outcome.CONFLICT


@numba.njit(cache=True)
def _root(rng, problem, s):
    """Return the start: the first node with a guide; else random, or that with most conflicts, on a cycle if any."""
    graph = problem.graph
    n = len(graph.labels)
    if len(problem.guide.parents) > 0:
        return 0
    if not problem.method.constrained:
        return min(np.int64(rng.random() * n), n - 1)
    cyclic = graph.core.any()
    best, best_weight = NO_NODE, -1.0
    for node in range(n):
        weight = s.weights[node] + rng.random()
        if weight > best_weight and (graph.core[node] or not cyclic):
            best, best_weight = node, weight
    return best


@numba.njit(cache=True)
def _open_root(problem, s, node):
    """Open the domain of the first node: a part of its label in any orientation. False if there is no room."""
    placements = problem.placements
    label = problem.graph.labels[node]
    s.domain_start[node] = 0
    s.domain_size[node] = 0
    for orientation in range(placements.orientation_starts[label], placements.orientation_starts[label + 1]):
        if not _add_value(problem, s, node, orientation, placements.rests[orientation], np.zeros(3)):
            return False
        s.domain_size[node] += 1
    s.domain_end[node] = s.counts[N_VALUES]
    return True


@numba.njit(cache=True)
def _add_value(problem, s, node, orientation, rotation, translation):
    """Append a value. False if there is no room."""
    boxes = problem.kit.boxes
    value = s.counts[N_VALUES]
    if value == len(s.types):
        return False
    s.counts[N_VALUES] += 1
    kind = problem.placements.orientation_types[orientation]
    s.types[value] = kind
    s.orientations[value] = orientation
    s.nodes[value] = node
    s.scores[value] = 0.0
    s.in_domain[value] = True
    for i in range(3):
        centre, half = translation[i], 0.0
        for j in range(3):
            s.rotations[value, i, j] = rotation[i, j]
            centre += rotation[i, j] * boxes[kind, 0, j]
            half += abs(rotation[i, j]) * boxes[kind, 1, j]
        s.translations[value, i] = translation[i]
        s.boxes[value, 0, i] = centre
        s.boxes[value, 1, i] = half
    return True


@numba.njit(cache=True)
def _next(rng, problem, s):
    """Return OK and the next node to place, its domain open; or CONFLICT or NO_ROOM."""
    graph, method = problem.graph, problem.method
    if not method.constrained:
        return _random_next(rng, problem, s)
    while True:
        best, least = NO_NODE, np.inf
        for node in range(len(graph.labels)):
            if s.domain_start[node] >= 0 and s.assigned[node] < 0:
                size = s.domain_size[node] / s.weights[node]
                if s.domain_size[node] == 1:
                    size = 0.0
                elif not graph.core[node]:
                    size += LEAF_PENALTY
                if size < least:
                    best, least = node, size
        before = s.domain_size[best]
        if method.closes and before > 1 and graph.core[best]:
            _prune_unclosable(problem, s, np.int64(best))
            if s.domain_size[best] == 0:
                s.weights[best] += 1.0
                return Outcome.CONFLICT, best
            if s.domain_size[best] < before:
                continue
        return Outcome.OK, best


@numba.njit(cache=True)
def _random_next(rng, problem, s):
    """Return the same for a random node next to a placed one, which alone determines its domain."""
    graph, method = problem.graph, problem.method
    n, count = len(graph.labels), 0
    for node in range(n):
        if s.domain_start[node] >= 0 and s.assigned[node] < 0:
            return (Outcome.OK if s.domain_size[node] > 0 else Outcome.CONFLICT), node
    chosen, parent = NO_NODE, NO_NODE
    for node in range(n):
        if s.assigned[node] >= 0:
            for k in range(graph.starts[node], graph.starts[node + 1]):
                if s.assigned[graph.ends[k]] < 0:
                    count += 1
                    if rng.random() * count < 1.0:
                        chosen, parent = graph.ends[k], node
    if not _open_domain(problem, s, np.int64(chosen), np.int64(parent)):
        return Outcome.NO_ROOM, chosen
    if method.closes and graph.core[chosen]:
        _prune_unclosable(problem, s, np.int64(chosen))
    return (Outcome.OK if s.domain_size[chosen] > 0 else Outcome.CONFLICT), chosen


@numba.njit(cache=True)
def _choose(rng, s, node):
    """Return the value with the highest score, a random one of equals."""
    best, best_score, ties = -1, -np.inf, 0
    for value in range(s.domain_start[node], s.domain_end[node]):
        if s.in_domain[value]:
            if s.scores[value] > best_score:
                best, best_score, ties = value, s.scores[value], 1
            elif s.scores[value] == best_score:
                ties += 1
                if rng.random() * ties < 1.0:
                    best = value
    return best


@numba.njit(cache=True)
def _open_domain(problem, s, node, parent):
    """Open the domain of a node: placements docked to its parent that agree with all placed parts.

    False if there is no room.
    """
    placements = problem.placements
    _push_opened(s, node)
    s.domain_start[node] = s.counts[N_VALUES]
    s.domain_end[node] = s.domain_start[node]
    s.domain_size[node] = 0
    base = s.assigned[parent]
    labels = len(placements.orientation_starts) - 1
    row = s.orientations[base] * labels + problem.graph.labels[node]
    rotation, translation = np.empty((3, 3)), np.empty(3)
    for placement in range(placements.starts[row], placements.starts[row + 1]):
        compose(
            s.rotations[base], s.translations[base],
            placements.rotations[placement], placements.translations[placement], rotation, translation,
        )  # fmt: skip
        if not _add_value(problem, s, node, placements.orientations[placement], rotation, translation):
            return False
        value = s.counts[N_VALUES] - 1
        agrees = True
        if problem.method.checked:
            for k in range(s.counts[N_PLACED]):
                if not _agree(problem, s, s.assigned[s.order[k]], value):
                    agrees = False
                    break
        if agrees:
            s.domain_size[node] += 1
        else:
            s.counts[N_VALUES] -= 1
    s.domain_end[node] = s.counts[N_VALUES]
    return True


@numba.njit(cache=True)
def _agree(problem, s, placed, value):
    """Return whether a value agrees with a placed part: joined parts touch, and with all contacts no others."""
    is_edge = problem.graph.rows[s.nodes[placed], s.nodes[value]] >= 0
    relation = _relation(problem.kit, problem.contacts, s, placed, value)
    if relation < 0:
        return relation == NO_CONTACT and not is_edge
    return is_edge or not problem.method.whole


@numba.njit(cache=True)
def _relation(kit, contacts, s, a, b):
    """Return the contact of two values: NO_CONTACT, FORBIDDEN_CONTACT or, if they dock, a number from 0."""
    slack = 1.1 * kit.limits[1]
    for i in range(3):
        if abs(s.boxes[a, 0, i] - s.boxes[b, 0, i]) > s.boxes[a, 1, i] + s.boxes[b, 1, i] + slack:
            return NO_CONTACT
    if s.types[a] > s.types[b]:
        a, b = b, a
    quanta = np.empty(12, dtype=np.int64)
    kind = s.types[b]
    quantize_pose(
        s.rotations[a], s.translations[a], s.rotations[b], s.translations[b], kit.reach[kind], kit.limits[2], quanta
    )
    relation = look_up(contacts.keys, contacts.values, contact_key(s.types[a], kind, quanta))
    if relation == UNKNOWN_CONTACT:
        relation = call_oracle(contacts.oracle_address, a, b)
    return relation


@numba.njit(cache=True)
def _place(problem, s, value):
    """Place a part, prune open domains against it, and open the domains of its neighbours."""
    graph, method = problem.graph, problem.method
    node = s.nodes[value]
    _push_placed(s, node)
    s.assigned[node] = value
    s.order[s.counts[N_PLACED]] = node
    s.counts[N_PLACED] += 1
    if method.checked and not method.whole:
        _count_neighbours(problem, s, value)
    if not method.constrained:
        return Outcome.OK
    for other in range(len(graph.labels)):
        if s.domain_start[other] >= 0 and s.assigned[other] < 0:
            for candidate in range(s.domain_start[other], s.domain_end[other]):
                if s.in_domain[candidate] and method.checked and not _agree(problem, s, value, candidate):
                    _prune(s, candidate)
            if s.domain_size[other] == 0:
                s.weights[other] += 1.0
                return Outcome.CONFLICT
    for k in range(graph.starts[node], graph.starts[node + 1]):
        other = graph.ends[k]
        if s.domain_start[other] < 0:
            if not _open_domain(problem, s, other, node):
                return Outcome.NO_ROOM
            if s.domain_size[other] == 0:
                s.weights[other] += 1.0
                return Outcome.CONFLICT
    return Outcome.OK


@numba.njit(cache=True)
def _count_neighbours(problem, s, value):
    """Count the contacts of the part placed last."""
    labels = problem.graph.labels
    node = s.nodes[value]
    for k in range(s.counts[N_PLACED] - 1):
        other = s.order[k]
        if _relation(problem.kit, problem.contacts, s, s.assigned[other], value) >= 0:
            s.touches[node, other] = True
            s.neighbours[node, labels[other]] += 1
            s.neighbours[other, labels[node]] += 1


@numba.njit(cache=True)
def _score_by_contacts(problem, s, node):
    """Score the values of a node by their number of contacts; prune those whose contacts the grammar cannot admit."""
    graph_labels = problem.graph.labels
    label, labels = graph_labels[node], len(problem.kit.rules.patterns.counted)
    own, around = np.zeros(labels, dtype=np.int64), np.zeros(labels, dtype=np.int64)
    for value in range(s.domain_start[node], s.domain_end[node]):
        if not s.in_domain[value]:
            continue
        contacts, fits = 0, True
        own[:] = 0
        for k in range(s.counts[N_PLACED]):
            other = s.order[k]
            if _relation(problem.kit, problem.contacts, s, s.assigned[other], value) >= 0:
                contacts += 1
                own[graph_labels[other]] += 1
                for kind in range(labels):
                    around[kind] = s.neighbours[other, kind]
                around[label] += 1
                if not _can_be_complete(problem, s, other, node, around):
                    fits = False
                    break
        if fits and _can_be_complete(problem, s, node, node, own):
            s.scores[value] = contacts
        else:
            _prune(s, value)


@numba.njit(cache=True)
def _can_be_complete(problem, s, node, fresh, counts):
    """Return whether the grammar admits a neighbourhood with at least the neighbours of a node.

    counts: those placed, by label; those of the graph that are not placed, but for `fresh`, are added to it.
    """
    graph = problem.graph
    for k in range(graph.starts[node], graph.starts[node + 1]):
        other = graph.ends[k]
        if s.assigned[other] < 0 and other != fresh:
            counts[graph.labels[other]] += 1
    return fits(problem.kit.rules.patterns, graph.labels[node], counts, False)


@numba.njit(cache=True)
def _all_complete(problem, s):
    """Return whether the grammar admits the neighbourhood of every part."""
    labels = problem.graph.labels
    wrong = 0
    for node in range(len(labels)):
        wrong += not fits(problem.kit.rules.patterns, labels[node], s.neighbours[node], True)
    return wrong == 0


@numba.njit(cache=True)
def _prune_unclosable(problem, s, node):
    """Prune the values of a node from which no chain of parts closes its shortest cycle of unplaced nodes."""
    graph = problem.graph
    n = len(graph.labels)
    before = s.before
    before[:n] = -1
    before[node] = node
    s.queue[0] = node
    head, tail, end, link = 0, 1, NO_NODE, NO_NODE
    while head < tail and end < 0:
        reached = s.queue[head]
        head += 1
        for k in range(graph.starts[reached], graph.starts[reached + 1]):
            other = graph.ends[k]
            if s.assigned[other] >= 0:
                if reached != node:
                    end, link = other, reached
                    break
            elif graph.core[other] and before[other] < 0:
                before[other] = reached
                s.queue[tail] = other
                tail += 1
    if end < 0:
        return
    sequence = np.empty(MAX_CHAIN_LENGTH + 1, dtype=np.int64)
    length = 0
    while length <= MAX_CHAIN_LENGTH:
        sequence[length] = graph.labels[link]
        length += 1
        if link == node:
            break
        link = before[link]
    base = s.assigned[end]
    rotation, translation = np.empty((3, 3)), np.empty(3)
    for value in range(s.domain_start[node], s.domain_end[node]):
        if not s.in_domain[value]:
            continue
        relative_transform(
            s.rotations[base], s.translations[base], s.rotations[value], s.translations[value], rotation, translation
        )
        if not can_reach(
            problem.kit, problem.placements, problem.reach,
            s.orientations[base], sequence, length, s.orientations[value], rotation, translation,
        ):  # fmt: skip
            _prune(s, value)


@numba.njit(cache=True)
def _prune(s, value):
    """Take a value out of its domain."""
    s.in_domain[value] = False
    s.domain_size[s.nodes[value]] -= 1
    _push_pruned(s, value)


@numba.njit(cache=True)
def _undo(graph, s, length):
    """Undo everything since the trail had some length."""
    while s.counts[TRAIL_LENGTH] > length:
        s.counts[TRAIL_LENGTH] -= 1
        entry = s.trail[s.counts[TRAIL_LENGTH]]
        if _is_pruned(entry):
            s.in_domain[entry] = True
            s.domain_size[s.nodes[entry]] += 1
        elif _is_placed(s, entry):
            _remove(graph, s, _placed_node(entry))
        else:
            node = _opened_node(s, entry)
            s.counts[N_VALUES] = s.domain_start[node]
            s.domain_start[node] = -1


@numba.njit(cache=True)
def _remove(graph, s, node):
    """Remove the part placed last."""
    s.assigned[node] = -1
    s.counts[N_PLACED] -= 1
    for k in range(s.counts[N_PLACED]):
        other = s.order[k]
        if s.touches[node, other]:
            s.touches[node, other] = False
            s.neighbours[node, graph.labels[other]] -= 1
            s.neighbours[other, graph.labels[node]] -= 1


# Encoding of the trail: a pruned value is its row, a placed node -1 - node, an opened one -1 - len(assigned) - node.


@numba.njit(cache=True)
def _push(s, entry):
    s.trail[s.counts[TRAIL_LENGTH]] = entry
    s.counts[TRAIL_LENGTH] += 1


@numba.njit(cache=True)
def _push_pruned(s, value):
    _push(s, value)


@numba.njit(cache=True)
def _push_placed(s, node):
    _push(s, -1 - node)


@numba.njit(cache=True)
def _push_opened(s, node):
    _push(s, -1 - len(s.assigned) - node)


@numba.njit(cache=True)
def _is_pruned(entry):
    return entry >= 0


@numba.njit(cache=True)
def _is_placed(s, entry):
    return -len(s.assigned) <= entry < 0


@numba.njit(cache=True)
def _placed_node(entry):
    return -1 - entry


@numba.njit(cache=True)
def _opened_node(s, entry):
    return -1 - len(s.assigned) - entry
