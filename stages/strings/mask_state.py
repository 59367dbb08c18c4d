"""The state of strings that grow token by token, and its transitions.

Tokens are numbers: END_TOKEN; then the types from 1; then `(`, `)`; then the cycle numbers from 0.

Numba compiles this module when it is imported: import it inside functions.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np

from stages.strings.completion import NO_COMPLETION, tokens_to_complete

END_TOKEN = 0
NO_NODE = -1
START, NODE, OPEN, CLOSE, ENDED = range(5)
"""The last token; a cycle number counts as its node."""


class MaskState(NamedTuple):
    """Strings by row i, with at most n nodes each."""

    kind: np.ndarray  # int16 (i, n): type of each node
    parent: np.ndarray  # int32 (i, n)
    counts: np.ndarray  # int16 (i, n, types): neighbours by type
    pending: np.ndarray  # int16 (i, n): open cycles that start at the node
    need: np.ndarray  # int64 (i, n): fewest tokens that complete the node
    finished: np.ndarray  # bool (i, n): only ends of its open cycles can be added to the node
    stack: np.ndarray  # int32 (i, n): nodes of the open branches
    depth: np.ndarray  # int32 (i,): number of open branches
    current: np.ndarray  # int32 (i,): node that the next token hangs on
    previous: np.ndarray  # int8 (i,): START, NODE, OPEN, CLOSE or ENDED
    nodes: np.ndarray  # int32 (i,): number of nodes
    length: np.ndarray  # int32 (i,): number of tokens
    opened: np.ndarray  # int32 (i, cycles): node where the open cycle starts, or -1
    certificate: np.ndarray  # int32 (i, cycles): node below which the open cycle can close, or -1 if none is known
    partners: np.ndarray  # int32 (i, n): nodes that cycles join to the current node
    joins: np.ndarray  # int32 (i,): their number


def empty_state(strings: int, max_tokens: int, types: int, cycles: int) -> MaskState:
    """Return the state of empty strings with room for `max_tokens` tokens each."""
    shape = (strings, max_tokens + 1)
    return MaskState(
        kind=np.zeros(shape, np.int16),
        parent=np.full(shape, NO_NODE, np.int32),
        counts=np.zeros((*shape, types), np.int16),
        pending=np.zeros(shape, np.int16),
        need=np.zeros(shape, np.int64),
        finished=np.zeros(shape, np.bool_),
        stack=np.zeros(shape, np.int32),
        depth=np.zeros(strings, np.int32),
        current=np.full(strings, NO_NODE, np.int32),
        previous=np.full(strings, START, np.int8),
        nodes=np.zeros(strings, np.int32),
        length=np.zeros(strings, np.int32),
        opened=np.full((strings, cycles), NO_NODE, np.int32),
        certificate=np.full((strings, cycles), NO_NODE, np.int32),
        partners=np.zeros(shape, np.int32),
        joins=np.zeros(strings, np.int32),
    )


@numba.njit(cache=True)
def update_need(grammar, state, i, node):
    """Update the tokens that complete a node; return whether it can be completed."""
    need = tokens_to_complete(
        grammar, state.kind[i, node], state.counts[i, node], state.pending[i, node], state.finished[i, node]
    )
    state.need[i, node] = need
    return need < NO_COMPLETION


@numba.njit(cache=True)
def add_node(grammar, state, i, kind):
    """Append a node; return whether it and its parent can be completed."""
    new, parent = state.nodes[i], state.current[i]
    state.kind[i, new], state.parent[i, new] = kind, parent
    state.counts[i, new, :] = 0
    state.pending[i, new] = 0
    state.finished[i, new] = False
    fits = True
    if new > 0:
        if state.previous[i] != OPEN:
            state.finished[i, parent] = True
        state.counts[i, parent, kind] += 1
        state.counts[i, new, state.kind[i, parent]] = 1
        fits = update_need(grammar, state, i, parent)
    state.nodes[i] += 1
    state.current[i] = new
    state.previous[i] = NODE
    state.joins[i] = 0
    return update_need(grammar, state, i, new) and fits


@numba.njit(cache=True)
def remove_node(state, i, previous, need, joins):
    """Undo `add_node`."""
    new = state.nodes[i] - 1
    parent = state.parent[i, new]
    if new > 0:
        state.counts[i, parent, state.kind[i, new]] -= 1
        state.finished[i, parent] = False
        state.need[i, parent] = need
    state.nodes[i] = new
    state.current[i] = parent
    state.previous[i] = previous
    state.joins[i] = joins


@numba.njit(cache=True)
def not_joined(state, i, origin):
    """Return whether the current node differs from `origin` and is no neighbour of it."""
    current = state.current[i]
    if origin == current or state.parent[i, current] == origin:
        return False
    joined = False
    for index in range(state.joins[i]):
        joined |= state.partners[i, index] == origin
    return not joined


@numba.njit(cache=True)
def close_cycle(grammar, state, i, k):
    """Close cycle number k at the current node; return whether both ends can be completed."""
    origin, current = state.opened[i, k], state.current[i]
    state.counts[i, origin, state.kind[i, current]] += 1
    state.counts[i, current, state.kind[i, origin]] += 1
    state.pending[i, origin] -= 1
    state.opened[i, k] = -1
    state.partners[i, state.joins[i]] = origin
    state.joins[i] += 1
    fits = update_need(grammar, state, i, origin)
    return update_need(grammar, state, i, current) and fits


@numba.njit(cache=True)
def open_cycles(state, i):
    """Return the number of open cycles."""
    opened = 0
    for k in range(state.opened.shape[1]):
        opened += state.opened[i, k] >= 0
    return opened


@numba.njit(cache=True)
def can_leave(grammar, state, i):
    """Return whether the current node is complete but for its open cycles."""
    node = state.current[i]
    kind, counts, pending = state.kind[i, node], state.counts[i, node], state.pending[i, node]
    return tokens_to_complete(grammar, kind, counts, pending, np.bool_(True)) < NO_COMPLETION
