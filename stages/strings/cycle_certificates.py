"""Certificates of open cycles: nodes below which they can still close.

A certificate stays valid as long as neither its node nor the start of the cycle changes.

Numba compiles this module when it is imported: import it inside functions.
"""

from __future__ import annotations

import numba
import numpy as np

from stages.strings.completion import NO_COMPLETION, tokens_to_complete
from stages.strings.mask_state import NO_NODE, NODE, not_joined, open_cycles

AT_CURRENT = -2
"""The cycle can close at the current node, but not below it."""


@numba.njit(cache=True)
def can_complete(grammar, state, i, tokens, first, second):
    """Return whether everything open can be completed within some tokens, each node and cycle by itself.

    first, second: the nodes that a token on trial has changed or left.
    """
    total = state.need[i, state.current[i]] + open_cycles(state, i)
    for d in range(state.depth[i]):
        total += state.need[i, state.stack[i, d]] + 1
    if total > tokens:
        return False
    for k in range(state.opened.shape[1]):
        origin, certificate = state.opened[i, k], state.certificate[i, k]
        if origin < 0 or (certificate >= 0 and not _is_either(first, second, origin, certificate)):
            continue
        if _closing_node(grammar, state, i, k) == NO_NODE:
            return False
    return True


@numba.njit(cache=True)
def _is_either(first, second, origin, certificate):
    return first in (origin, certificate) or second in (origin, certificate)


@numba.njit(cache=True)
def find_certificates(grammar, state, i):
    """Find a certificate of each open cycle without one, so that most tokens need only a look at it."""
    for k in range(state.opened.shape[1]):
        if state.opened[i, k] >= 0 and state.certificate[i, k] < 0:
            state.certificate[i, k] = max(_closing_node(grammar, state, i, k), NO_NODE)


@numba.njit(cache=True)
def forget_certificates(state, i, first, second):
    """Forget the certificates of cycles that start, or close, at one of two nodes."""
    for k in range(state.opened.shape[1]):
        if state.opened[i, k] < 0 or _is_either(first, second, state.opened[i, k], state.certificate[i, k]):
            state.certificate[i, k] = NO_NODE


@numba.njit(cache=True)
def _closing_node(grammar, state, i, k):
    """Return a node below which open cycle k can close; else AT_CURRENT if it can close there; else NO_NODE."""
    origin = state.opened[i, k]
    kind = state.kind[i, origin]
    counts = state.counts[i, origin]
    best = NO_NODE
    for other in range(len(counts)):
        goal = grammar.arc[kind, other]
        if goal < 0:
            continue
        counts[other] += 1
        state.pending[i, origin] -= 1
        pending, finished = state.pending[i, origin], state.finished[i, origin]
        if tokens_to_complete(grammar, kind, counts, pending, finished) < NO_COMPLETION:
            node = _closing_node_of_type(grammar, state, i, origin, other, goal)
            best = node if node != NO_NODE else best
        counts[other] -= 1
        state.pending[i, origin] += 1
        if best >= 0:
            break
    return best


@numba.njit(cache=True)
def _closing_node_of_type(grammar, state, i, origin, other, goal):
    """Return the same for an end of type `other`; `goal` is the pair of types that the cycle joins."""
    current = state.current[i]
    for d in range(state.depth[i] + 1):
        node = state.stack[i, d] if d < state.depth[i] else current
        if state.finished[i, node]:
            continue
        kind = state.kind[i, node]
        counts = state.counts[i, node]
        for child in range(len(counts)):
            arc = grammar.arc[kind, child]
            if arc < 0 or not (grammar.closes_below[arc, goal] if node == origin else grammar.closes[arc, goal]):
                continue
            counts[child] += 1
            fits = tokens_to_complete(grammar, kind, counts, state.pending[i, node], np.bool_(False)) < NO_COMPLETION
            counts[child] -= 1
            if fits:
                return node
    if state.previous[i] == NODE and state.kind[i, current] == other and not_joined(state, i, origin):
        state.counts[i, current, state.kind[i, origin]] += 1
        kind, counts, pending = state.kind[i, current], state.counts[i, current], state.pending[i, current]
        fits = tokens_to_complete(grammar, kind, counts, pending, np.bool_(False)) < NO_COMPLETION
        state.counts[i, current, state.kind[i, origin]] -= 1
        if fits:
            return AT_CURRENT
    return NO_NODE
