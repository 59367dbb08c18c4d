"""Putting a graph together: part after part at a docking beside one that stands, with ways back (strings §6)."""

from __future__ import annotations

import numba
import numpy as np

from stages.shape.geometry.contact_lookup import NO_CONTACT, UNKNOWN_CONTACT, call_oracle, contact_key, quantize_pose
from stages.shape.geometry.hash_tables import look_up
from stages.string_sampling.instantiation.guidance import drop_frames, propagate_frames, score_by_category
from stages.string_sampling.instantiation.reach import LONGEST, can_reach
from stages.string_sampling.instantiation.state import FAILS, PLACED, TRAIL, TRIES, VALUES
from stages.string_sampling.instantiation.transforms import compose, relative_transform

SOLVED, IMPOSSIBLE, BUDGET, NO_ROOM = 0, 1, 2, 3
"""How it ended; IMPOSSIBLE: every way has been tried."""
FINE, CONFLICT = 4, 5
FAILS_A_NODE, MORE_FAILS = 4.0, 1.5
"""A shape is begun anew after so many dead ends for each node, and after more of them each time."""


@numba.njit(cache=True)
def solve(rng, kit, candidates, rules, contacts, graph, guide, method, reach, s):
    """Find a place for every node so that edges are contacts and nothing else touches. Where it stands is in `s`."""
    s.counts[TRIES] = 0
    s.weights[: len(graph.labels)] = 1.0
    fails = FAILS_A_NODE * len(graph.labels)
    while True:
        outcome = _attempt(rng, kit, candidates, rules, contacts, graph, guide, method, reach, s, np.int64(fails))
        if outcome != CONFLICT:
            return outcome
        fails *= MORE_FAILS


@numba.njit(cache=True)
def _attempt(rng, kit, candidates, rules, contacts, graph, guide, method, reach, s, fails):
    """One beginning. CONFLICT where it is given up."""
    n = len(graph.labels)
    s.counts[VALUES] = 0
    s.counts[PLACED] = 0
    s.counts[TRAIL] = 0
    s.counts[FAILS] = 0
    s.first[:n] = -1
    s.at[:n] = -1
    s.near[:n] = 0
    s.touch[:n] = False
    s.framed[:n] = False
    depth = 0
    if not _seed(candidates, kit, graph, s, _root(rng, graph, guide, method, s)):
        return NO_ROOM
    outcome = FINE
    while True:
        if outcome == FINE:
            if s.counts[PLACED] == n:
                if method.whole or not method.checked or not method.ended or _all_complete(rules, graph, s):
                    return SOLVED
                outcome = CONFLICT
                continue
            node = _next(rng, kit, candidates, contacts, graph, method, reach, s)
            if node == -1:
                outcome = CONFLICT
                continue
            if node == -2:
                return NO_ROOM
            if method.checked and not method.whole:
                _weigh(kit, rules, contacts, graph, s, node)
                if s.left[node] == 0:
                    s.weights[node] += 1.0
                    outcome = CONFLICT
                    continue
            if len(guide.parents) > 0:
                score_by_category(kit, guide, graph, s, node)
            if s.counts[TRIES] == method.budget:
                return BUDGET
            s.counts[TRIES] += 1
            value = _choose(rng, method, s, node)
            s.decisions[depth, 0] = s.counts[TRAIL]
            s.decisions[depth, 1] = value
            depth += 1
            outcome = _place(kit, candidates, contacts, graph, method, s, value)
            if len(guide.parents) > 0:
                propagate_frames(kit, guide, graph, s, value)
            if outcome == NO_ROOM:
                return NO_ROOM
        else:
            s.counts[FAILS] += 1
            if depth == 0:
                return IMPOSSIBLE if method.checked and method.constrained else CONFLICT
            if not method.backtracks or s.counts[FAILS] > fails:
                return CONFLICT
            depth -= 1
            _undo(graph, s, s.decisions[depth, 0])
            drop_frames(guide, s)
            value = s.decisions[depth, 1]
            _strike(s, value)
            outcome = FINE
            if s.left[s.nodes[value]] == 0:
                s.weights[s.nodes[value]] += 1.0
                outcome = CONFLICT


@numba.njit(cache=True)
def _root(rng, graph, guide, method, s):
    """Where to begin: with a guide at the first node, else at random, or where it went wrong most often, on a cycle if
    there is one."""
    n = len(graph.labels)
    if len(guide.parents) > 0:
        return 0
    if not method.constrained:
        return min(np.int64(rng.random() * n), n - 1)
    cyclic = graph.core.any()
    best, most = -1, -1.0
    for node in range(n):
        weight = s.weights[node] + rng.random()
        if weight > most and (graph.core[node] or not cyclic):
            best, most = node, weight
    return best


@numba.njit(cache=True)
def _seed(candidates, kit, graph, s, node):
    """The domain of the first node: a part of its label in any stance."""
    label = graph.labels[node]
    s.first[node] = 0
    s.left[node] = 0
    for stance in range(candidates.stance_starts[label], candidates.stance_starts[label + 1]):
        if not _add_value(kit, candidates, s, node, stance, candidates.rests[stance], np.zeros(3)):
            return False
        s.left[node] += 1
    s.last[node] = s.counts[VALUES]
    return True


@numba.njit(cache=True)
def _add_value(kit, candidates, s, node, stance, rotation, translation):
    """A value at the end of all; False where there is no room."""
    value = s.counts[VALUES]
    if value == len(s.types):
        return False
    s.counts[VALUES] += 1
    kind = candidates.stance_types[stance]
    s.types[value] = kind
    s.stances[value] = stance
    s.nodes[value] = node
    s.scores[value] = 0.0
    s.alive[value] = True
    for i in range(3):
        centre, half = translation[i], 0.0
        for j in range(3):
            s.rotations[value, i, j] = rotation[i, j]
            centre += rotation[i, j] * kit.boxes[kind, 0, j]
            half += abs(rotation[i, j]) * kit.boxes[kind, 1, j]
        s.translations[value, i] = translation[i]
        s.boxes[value, 0, i] = centre
        s.boxes[value, 1, i] = half
    return True


@numba.njit(cache=True)
def _next(rng, kit, candidates, contacts, graph, method, reach, s):
    """The node that is put down next, its domain made; -1 where a domain is empty, -2 where there is no room."""
    if not method.constrained:
        return _random_next(rng, kit, candidates, contacts, graph, method, reach, s)
    while True:
        best, least = -1, np.inf
        for node in range(len(graph.labels)):
            if s.first[node] >= 0 and s.at[node] < 0:
                size = s.left[node] / s.weights[node]
                if s.left[node] == 1:
                    size = 0.0
                elif not graph.core[node]:
                    size += 1e6
                if size < least:
                    best, least = node, size
        before = s.left[best]
        if method.closes and before > 1 and graph.core[best]:
            _close(kit, candidates, graph, reach, s, best)
            if s.left[best] == 0:
                s.weights[best] += 1.0
                return -1
            if s.left[best] < before:
                continue
        return best


@numba.njit(cache=True)
def _random_next(rng, kit, candidates, contacts, graph, method, reach, s):
    """A random node beside one that stands, with the domain that one of these gives it."""
    n, found = len(graph.labels), 0
    for each in range(n):
        if s.first[each] >= 0 and s.at[each] < 0:
            return each if s.left[each] > 0 else -1
    node, parent = -1, -1
    for each in range(n):
        if s.at[each] >= 0:
            for k in range(graph.starts[each], graph.starts[each + 1]):
                if s.at[graph.ends[k]] < 0:
                    found += 1
                    if rng.random() * found < 1.0:
                        node, parent = graph.ends[k], each
    if not _make_domain(kit, candidates, contacts, graph, method, s, node, parent):
        return -2
    if method.closes and graph.core[node]:
        _close(kit, candidates, graph, reach, s, node)
    return node if s.left[node] > 0 else -1


@numba.njit(cache=True)
def _choose(rng, method, s, node):
    """The living value with the highest score, one at random of equals."""
    best, most, ties = -1, -np.inf, 0
    for value in range(s.first[node], s.last[node]):
        if s.alive[value]:
            if s.scores[value] > most:
                best, most, ties = value, s.scores[value], 1
            elif s.scores[value] == most:
                ties += 1
                if rng.random() * ties < 1.0:
                    best = value
    return best


@numba.njit(cache=True)
def _make_domain(kit, candidates, contacts, graph, method, s, node, parent):
    """The values of a node beside one that stands: those that no part is against. False where there is no room."""
    s.trail[s.counts[TRAIL]] = -1 - len(s.at) - node
    s.counts[TRAIL] += 1
    s.first[node] = s.counts[VALUES]
    s.last[node] = s.first[node]
    s.left[node] = 0
    base = s.at[parent]
    labels = len(candidates.stance_starts) - 1
    row = s.stances[base] * labels + graph.labels[node]
    rotation, translation = np.empty((3, 3)), np.empty(3)
    for candidate in range(candidates.starts[row], candidates.starts[row + 1]):
        compose(
            s.rotations[base], s.translations[base],
            candidates.rotations[candidate], candidates.translations[candidate], rotation, translation,
        )  # fmt: skip
        if not _add_value(kit, candidates, s, node, candidates.stances[candidate], rotation, translation):
            return False
        value = s.counts[VALUES] - 1
        good = True
        if method.checked:
            for k in range(s.counts[PLACED]):
                if not _agrees(kit, contacts, graph, method, s, s.at[s.order[k]], value):
                    good = False
                    break
        if good:
            s.left[node] += 1
        else:
            s.counts[VALUES] -= 1
    s.last[node] = s.counts[VALUES]
    return True


@numba.njit(cache=True)
def _agrees(kit, contacts, graph, method, s, placed, value):
    """Whether a value goes with a part that stands."""
    a, b = s.nodes[placed], s.nodes[value]
    is_edge = graph.rows[a, b] >= 0
    answer = _relation(kit, contacts, s, placed, value)
    if answer < 0:
        return answer == NO_CONTACT and not is_edge
    return is_edge or not method.whole


@numba.njit(cache=True)
def _relation(kit, contacts, s, a, b):
    """Return the contact of two values: NO_CONTACT, FORBIDDEN_CONTACT or, where they dock, a number from 0."""
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
    answer = look_up(contacts.keys, contacts.values, contact_key(s.types[a], kind, quanta))
    if answer == UNKNOWN_CONTACT:
        answer = call_oracle(contacts.oracle_address, a, b)
    return answer


@numba.njit(cache=True)
def _place(kit, candidates, contacts, graph, method, s, value):
    """Put a part down, hold what may come next against it, and find the domains of its neighbours."""
    node = s.nodes[value]
    s.trail[s.counts[TRAIL]] = -1 - node
    s.counts[TRAIL] += 1
    s.at[node] = value
    s.order[s.counts[PLACED]] = node
    s.counts[PLACED] += 1
    if method.checked and not method.whole:
        _count_neighbours(kit, contacts, graph, s, value)
    if not method.constrained:
        return FINE
    for other in range(len(graph.labels)):
        if s.first[other] >= 0 and s.at[other] < 0:
            for each in range(s.first[other], s.last[other]):
                if s.alive[each] and method.checked and not _agrees(kit, contacts, graph, method, s, value, each):
                    _strike(s, each)
            if s.left[other] == 0:
                s.weights[other] += 1.0
                return CONFLICT
    for k in range(graph.starts[node], graph.starts[node + 1]):
        other = graph.ends[k]
        if s.first[other] < 0:
            if not _make_domain(kit, candidates, contacts, graph, method, s, other, node):
                return NO_ROOM
            if s.left[other] == 0:
                s.weights[other] += 1.0
                return CONFLICT
    return FINE


@numba.njit(cache=True)
def _count_neighbours(kit, contacts, graph, s, value):
    """Count what a part touches that was put down last."""
    node = s.nodes[value]
    for k in range(s.counts[PLACED] - 1):
        other = s.order[k]
        if _relation(kit, contacts, s, s.at[other], value) >= 0:
            s.touch[node, other] = True
            s.near[node, graph.labels[other]] += 1
            s.near[other, graph.labels[node]] += 1


@numba.njit(cache=True)
def _weigh(kit, rules, contacts, graph, s, node):
    """Strike the values of a node that touch parts as the grammar cannot admit; of the others those that touch most are
    the best."""
    label, labels = graph.labels[node], len(rules.counted)
    own, around = np.zeros(labels, dtype=np.int64), np.zeros(labels, dtype=np.int64)
    for value in range(s.first[node], s.last[node]):
        if not s.alive[value]:
            continue
        touched, good = 0, True
        own[:] = 0
        for k in range(s.counts[PLACED]):
            other = s.order[k]
            if _relation(kit, contacts, s, s.at[other], value) >= 0:
                touched += 1
                own[graph.labels[other]] += 1
                for each in range(labels):
                    around[each] = s.near[other, each]
                around[label] += 1
                if not _may_be_complete(rules, graph, s, other, node, around):
                    good = False
                    break
        if good and _may_be_complete(rules, graph, s, node, node, own):
            s.scores[value] = touched
        else:
            _strike(s, value)


@numba.njit(cache=True)
def _may_be_complete(rules, graph, s, node, fresh, counts):
    """Whether the neighbours `counts` by label that a node has, those that it must have yet, but for `fresh`, and any
    others can be what the grammar asks for. Adds to `counts`."""
    for k in range(graph.starts[node], graph.starts[node + 1]):
        other = graph.ends[k]
        if s.at[other] < 0 and other != fresh:
            counts[graph.labels[other]] += 1
    return _fits(rules, graph.labels[node], counts, False)


@numba.njit(cache=True)
def _all_complete(rules, graph, s):
    """Whether every part has what the grammar asks for."""
    wrong = 0
    for node in range(len(graph.labels)):
        wrong += not _fits(rules, graph.labels[node], s.near[node], True)
    return wrong == 0


@numba.njit(cache=True)
def _fits(rules, label, counts, complete):
    """Whether neighbours by label fit a pattern of the rules; unless they are `complete`, with others besides."""
    labels, total = len(rules.counted), 0
    for each in range(labels):
        if rules.counted[each]:
            total += counts[each]
    for pattern in range(rules.first[label], rules.first[label + 1]):
        lacking, good = 0, True
        for each in range(labels):
            if counts[each] > rules.high[pattern, each]:
                good = False
                break
            lacking += max(rules.low[pattern, each] - counts[each], 0)
        size = rules.size[pattern]
        if not good or (complete and lacking > 0):
            continue
        if size < 0 or total + lacking == size or (not complete and total + lacking < size):
            return True
    return False


@numba.njit(cache=True)
def _close(kit, candidates, graph, reach, s, node):
    """Strike the values of a node from which no chain of parts leads to where the shortest way along nodes that do not
    stand yet ends."""
    n = len(graph.labels)
    before = s.before
    before[:n] = -1
    before[node] = node
    s.queue[0] = node
    head, tail, end, link = 0, 1, -1, -1
    while head < tail and end < 0:
        each = s.queue[head]
        head += 1
        for k in range(graph.starts[each], graph.starts[each + 1]):
            other = graph.ends[k]
            if s.at[other] >= 0:
                if each != node:
                    end, link = other, each
                    break
            elif graph.core[other] and before[other] < 0:
                before[other] = each
                s.queue[tail] = other
                tail += 1
    if end < 0:
        return
    sequence = np.empty(LONGEST + 1, dtype=np.int64)
    length = 0
    while length <= LONGEST:
        sequence[length] = graph.labels[link]
        length += 1
        if link == node:
            break
        link = before[link]
    base = s.at[end]
    rotation, translation = np.empty((3, 3)), np.empty(3)
    for value in range(s.first[node], s.last[node]):
        if not s.alive[value]:
            continue
        relative_transform(
            s.rotations[base], s.translations[base], s.rotations[value], s.translations[value], rotation, translation
        )
        if not can_reach(
            kit, candidates, reach, s.stances[base], sequence, length, s.stances[value], rotation, translation
        ):
            _strike(s, value)


@numba.njit(cache=True)
def _strike(s, value):
    """Take a value out of its domain."""
    s.alive[value] = False
    s.left[s.nodes[value]] -= 1
    s.trail[s.counts[TRAIL]] = value
    s.counts[TRAIL] += 1


@numba.njit(cache=True)
def _undo(graph, s, length):
    """Take back everything since the trail was so long."""
    most = len(s.at)
    while s.counts[TRAIL] > length:
        s.counts[TRAIL] -= 1
        entry = s.trail[s.counts[TRAIL]]
        if entry >= 0:
            s.alive[entry] = True
            s.left[s.nodes[entry]] += 1
        elif entry >= -most:
            _take_off(graph, s, -1 - entry)
        else:
            node = -1 - most - entry
            s.counts[VALUES] = s.first[node]
            s.first[node] = -1


@numba.njit(cache=True)
def _take_off(graph, s, node):
    """Take the part that was put down last away."""
    s.at[node] = -1
    s.counts[PLACED] -= 1
    for k in range(s.counts[PLACED]):
        other = s.order[k]
        if s.touch[node, other]:
            s.touch[node, other] = False
            s.near[node, graph.labels[other]] -= 1
            s.near[other, graph.labels[node]] -= 1
