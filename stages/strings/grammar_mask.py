"""Which tokens may follow the beginning of a string, so that a string of the tiling grammar can still come of it.

Tokens are numbers: 0 ends a string; then come the types, `(`, `)`, and the cycle numbers from 0. A token is left out if
no string that begins so is well-formed (`stages.strings.decoder`) and admitted (`stages.strings.grammar_check`),
can be told from each node alone: its neighbours so far fit into a pattern of its type; and a subtree of it can hold the
other end of each cycle that is open. So no token is left out that an admitted string has, but for want of room: what is
open must be closed in the tokens that are left, each cycle by a number and each node by subtrees without cycles.

Where no cycle is open the converse is true as well: the string can be ended from there. With several open cycles, each
may be closed alone but not all of them: then there may be no token left, and whoever writes the string must go back.

Numba compiles this module when it is imported: import it inside functions.
"""

from __future__ import annotations

from collections import namedtuple

import numba
import numpy as np
import numpy.typing as npt

from stages.strings.compiled_grammar import NO_COMPLETION, CompiledGrammar

END_TOKEN = 0
NO_TOKEN = -1
"""No token, and no node."""
_AT_CURRENT = -2
"""The current node, at which a cycle can close, but below which it cannot."""
_START, _NODE, _OPEN, _CLOSE, _ENDED = range(5)
"""What the last token was; a number counts as its node."""

_State = namedtuple(
    "_State",
    "kind parent counts pending need left stack depth current previous nodes length opened witness partners closed",
)
"""Of strings by row. Of each node: kind, its type; parent; counts, neighbours by type; pending, cycles that began at it
and are open; need, the fewest tokens that complete it; left, whether only the ends of its cycles can come to it.
stack, depth: the nodes of the open branches; current: the node that the next token hangs on; opened: the node of each
open number, or -1; witness: for each open number a node below which its cycle can close as long as neither that node
nor the one where it began changes, or -1 where none is known; partners, closed: the nodes that cycles join the current
node to, and how many they are."""


@numba.njit(cache=True)
def tokens_to_complete(rules, kind, counts, pending, left):
    """The fewest tokens of the children that a node still needs, with their parentheses, or NEVER.

    counts: int64 (types,), its neighbours; pending: edges of open cycles to come; left: it gets no more children.
    """
    best = NO_COMPLETION
    types = len(counts)
    for p in range(rules.first[kind], rules.first[kind + 1]):
        total, missing = 0, 0
        fits = True
        for t in range(types):
            if counts[t] > rules.high[p, t]:
                fits = False
                break
            if rules.counted[t]:
                total += counts[t]
            if counts[t] < rules.low[p, t]:
                missing += rules.low[p, t] - counts[t]
        if not fits:
            continue
        limited = rules.size[p] >= 0
        room = rules.size[p] - total if limited else missing + pending
        if missing > room:
            continue
        if rules.partial:
            if pending <= room or rules.loose[p]:
                return 0
            continue
        if left:
            if missing <= pending and (not limited or room == pending or (room < pending and rules.loose[p])):
                return 0
            continue
        if room < pending and not rules.loose[p]:
            continue
        best = min(best, _cheapest(rules, p, kind, counts, missing, room if limited else missing, pending))
    return best


@numba.njit(cache=True)
def _cheapest(rules, p, kind, counts, missing, room, pending):
    """Tokens of the children that fill `room` places of pattern p, where `pending` of them, those that cost most, are
    filled by cycles."""
    children = max(room - pending, 0)
    if children == 0:
        return 0
    fill = NO_COMPLETION
    for t in range(len(counts)):
        if counts[t] < rules.high[p, t] and rules.counted[t]:
            fill = min(fill, rules.cost[kind, t])
    total = fill * (room - missing) if room > missing else 0
    dearest_total = 0
    for t in range(len(counts)):
        if counts[t] < rules.low[p, t]:
            total += rules.cost[kind, t] * (rules.low[p, t] - counts[t])
    if pending > 0:
        spare = pending
        last = NO_COMPLETION + 1
        while spare > 0:  # the dearest first
            dearest, number = -1, 0
            if room > missing and fill < last:
                dearest, number = fill, room - missing
            for t in range(len(counts)):
                if counts[t] < rules.low[p, t]:
                    cost = rules.cost[kind, t]
                    if cost < last:
                        if cost > dearest:
                            dearest, number = cost, rules.low[p, t] - counts[t]
                        elif cost == dearest:
                            number += rules.low[p, t] - counts[t]
            if dearest < 0:
                break
            taken = min(spare, number)
            dearest_total += taken * dearest
            spare -= taken
            last = dearest
    return min(total - dearest_total + 2 * (children - 1), NO_COMPLETION)


@numba.njit(cache=True)
def _update(rules, state, i, node):
    need = tokens_to_complete(
        rules, state.kind[i, node], state.counts[i, node], state.pending[i, node], state.left[i, node]
    )
    state.need[i, node] = need
    return need < NO_COMPLETION


@numba.njit(cache=True)
def _add_node(rules, state, i, kind):
    """Append a node; whether it and its parent can be completed."""
    new, parent = state.nodes[i], state.current[i]
    state.kind[i, new], state.parent[i, new] = kind, parent
    state.counts[i, new, :] = 0
    state.pending[i, new] = 0
    state.left[i, new] = False
    fits = True
    if new > 0:
        if state.previous[i] != _OPEN:
            state.left[i, parent] = True
        state.counts[i, parent, kind] += 1
        state.counts[i, new, state.kind[i, parent]] = 1
        fits = _update(rules, state, i, parent)
    state.nodes[i] += 1
    state.current[i] = new
    state.previous[i] = _NODE
    state.closed[i] = 0
    return _update(rules, state, i, new) and fits


@numba.njit(cache=True)
def _remove_node(state, i, previous, need, closed):
    """Undo `_add_node`."""
    new = state.nodes[i] - 1
    parent = state.parent[i, new]
    if new > 0:
        state.counts[i, parent, state.kind[i, new]] -= 1
        state.left[i, parent] = False
        state.need[i, parent] = need
    state.nodes[i] = new
    state.current[i] = parent
    state.previous[i] = previous
    state.closed[i] = closed


@numba.njit(cache=True)
def _viable_node(rules, state, i, kind, tokens):
    """Whether a node may come next, with so many tokens left after it."""
    parent, previous, closed = state.current[i], state.previous[i], state.closed[i]
    if previous != _START and rules.arc[state.kind[i, parent], kind] < 0:
        return False
    need = state.need[i, parent] if previous != _START else 0
    viable = _add_node(rules, state, i, kind) and _viable(rules, state, i, tokens, parent, parent)
    _remove_node(state, i, previous, need, closed)
    return viable


@numba.njit(cache=True)
def _viable(rules, state, i, tokens, first, second):
    """Whether all that is open can be closed with so many tokens, each by itself. first, second: the nodes that a token
    on trial has changed or left."""
    total = state.need[i, state.current[i]] + _open_cycles(state, i)
    for d in range(state.depth[i]):
        total += state.need[i, state.stack[i, d]] + 1
    if total > tokens:
        return False
    for k in range(state.opened.shape[1]):
        origin, witness = state.opened[i, k], state.witness[i, k]
        if origin < 0 or (witness >= 0 and not _is_either(first, second, origin, witness)):
            continue
        if _where_closes(rules, state, i, k) == NO_TOKEN:
            return False
    return True


@numba.njit(cache=True)
def _is_either(first, second, origin, witness):
    return first in (origin, witness) or second in (origin, witness)


@numba.njit(cache=True)
def _find_witnesses(rules, state, i):
    """Find a witness of each open cycle that has none and may have one: then most tokens can be tried at the price of
    a look at each cycle."""
    for k in range(state.opened.shape[1]):
        if state.opened[i, k] >= 0 and state.witness[i, k] < 0:
            state.witness[i, k] = max(_where_closes(rules, state, i, k), NO_TOKEN)


@numba.njit(cache=True)
def _forget_witnesses(state, i, first, second):
    """Of the cycles that begin at one of two nodes, or whose witness is one of them."""
    for k in range(state.opened.shape[1]):
        if state.opened[i, k] < 0 or _is_either(first, second, state.opened[i, k], state.witness[i, k]):
            state.witness[i, k] = NO_TOKEN


@numba.njit(cache=True)
def _where_closes(rules, state, i, k):
    """A node below which, in what is to come, open cycle number k can close; else the current node where the cycle can
    close at it, as _AT_CURRENT; else NONE."""
    origin = state.opened[i, k]
    kind = state.kind[i, origin]
    counts = state.counts[i, origin]
    found = NO_TOKEN
    for other in range(len(counts)):
        goal = rules.arc[kind, other]
        if goal < 0:
            continue
        counts[other] += 1
        state.pending[i, origin] -= 1
        if tokens_to_complete(rules, kind, counts, state.pending[i, origin], state.left[i, origin]) < NO_COMPLETION:
            place = _where_comes(rules, state, i, origin, other, goal)
            found = place if place != NO_TOKEN else found
        counts[other] -= 1
        state.pending[i, origin] += 1
        if found >= 0:
            break
    return found


@numba.njit(cache=True)
def _where_comes(rules, state, i, origin, other, goal):
    """The same for a cycle that closes at a node of type `other`, whose pair of neighbour types is `goal`."""
    current = state.current[i]
    for d in range(state.depth[i] + 1):
        node = state.stack[i, d] if d < state.depth[i] else current
        if state.left[i, node]:
            continue
        kind = state.kind[i, node]
        counts = state.counts[i, node]
        for child in range(len(counts)):
            arc = rules.arc[kind, child]
            if arc < 0 or not (rules.closes_below[arc, goal] if node == origin else rules.closes[arc, goal]):
                continue
            counts[child] += 1
            fits = tokens_to_complete(rules, kind, counts, state.pending[i, node], False) < NO_COMPLETION
            counts[child] -= 1
            if fits:
                return node
    if state.previous[i] == _NODE and state.kind[i, current] == other and _not_joined(state, i, origin):
        state.counts[i, current, state.kind[i, origin]] += 1
        fits = (
            tokens_to_complete(rules, other, state.counts[i, current], state.pending[i, current], False) < NO_COMPLETION
        )
        state.counts[i, current, state.kind[i, origin]] -= 1
        if fits:
            return _AT_CURRENT
    return NO_TOKEN


@numba.njit(cache=True)
def _not_joined(state, i, origin):
    """Whether the current node is another than `origin`, and no neighbour of it."""
    current = state.current[i]
    if origin == current or state.parent[i, current] == origin:
        return False
    joined = False
    for place in range(state.closed[i]):
        joined |= state.partners[i, place] == origin
    return not joined


@numba.njit(cache=True)
def _close_cycle(rules, state, i, k):
    origin, current = state.opened[i, k], state.current[i]
    state.counts[i, origin, state.kind[i, current]] += 1
    state.counts[i, current, state.kind[i, origin]] += 1
    state.pending[i, origin] -= 1
    state.opened[i, k] = -1
    state.partners[i, state.closed[i]] = origin
    state.closed[i] += 1
    fits = _update(rules, state, i, origin)
    return _update(rules, state, i, current) and fits


@numba.njit(cache=True)
def _viable_number(rules, state, i, k, tokens):
    """Whether cycle number k may come next, with so many tokens left after it."""
    current, origin = state.current[i], state.opened[i, k]
    need = state.need[i, current]
    if origin < 0:
        state.pending[i, current] += 1
        state.opened[i, k] = current
        viable = _update(rules, state, i, current) and _viable(rules, state, i, tokens, current, current)
        state.pending[i, current] -= 1
        state.opened[i, k] = -1
        state.need[i, current] = need
        return viable
    if rules.arc[state.kind[i, origin], state.kind[i, current]] < 0 or not _not_joined(state, i, origin):
        return False
    needed = state.need[i, origin]
    viable = _close_cycle(rules, state, i, k) and _viable(rules, state, i, tokens, origin, current)
    state.closed[i] -= 1
    state.counts[i, origin, state.kind[i, current]] -= 1
    state.counts[i, current, state.kind[i, origin]] -= 1
    state.pending[i, origin] += 1
    state.opened[i, k] = origin
    state.need[i, origin], state.need[i, current] = needed, need
    return viable


@numba.njit(cache=True)
def _can_leave(rules, state, i):
    """Whether the current node is complete but for its open cycles."""
    node = state.current[i]
    kind, counts, pending = state.kind[i, node], state.counts[i, node], state.pending[i, node]
    return tokens_to_complete(rules, kind, counts, pending, True) < NO_COMPLETION


@numba.njit(cache=True)
def _viable_branch(rules, state, i, tokens):
    """Whether a branch may begin: whether some node may come in it."""
    types = len(rules.counted)
    previous, current = state.previous[i], state.current[i]
    state.stack[i, state.depth[i]] = current
    state.depth[i] += 1
    state.previous[i] = _OPEN
    viable = False
    for kind in range(types):
        if _viable_node(rules, state, i, kind, tokens - 1):
            viable = True
            break
    state.depth[i] -= 1
    state.previous[i] = previous
    return viable


@numba.njit(cache=True)
def _viable_end_of_branch(rules, state, i, tokens):
    node = state.current[i]
    previous = state.previous[i]
    state.depth[i] -= 1
    state.current[i] = state.stack[i, state.depth[i]]
    state.previous[i] = _CLOSE
    viable = _viable(rules, state, i, tokens, node, node)
    state.depth[i] += 1
    state.current[i] = node
    state.previous[i] = previous
    return viable


@numba.njit(cache=True)
def _may_come(rules, state, i, most, token):
    """Whether a token may come next in a string of at most `most` tokens."""
    types = len(rules.counted)
    previous = state.previous[i]
    if previous == _ENDED:
        return token == END_TOKEN
    tokens = most - state.length[i] - 1
    if 1 <= token <= types:
        return tokens >= 0 and _viable_node(rules, state, i, token - 1, tokens)
    if previous in (_START, _OPEN):
        return False
    if token == END_TOKEN:
        return state.depth[i] == 0 and _open_cycles(state, i) == 0 and _can_leave(rules, state, i)
    if tokens < 0:
        return False
    if token == types + 1:
        return _viable_branch(rules, state, i, tokens)
    if token == types + 2:
        return state.depth[i] > 0 and _can_leave(rules, state, i) and _viable_end_of_branch(rules, state, i, tokens)
    return previous == _NODE and _viable_number(rules, state, i, token - types - 3, tokens)


@numba.njit(cache=True)
def _open_cycles(state, i):
    opened = 0
    for k in range(state.opened.shape[1]):
        opened += state.opened[i, k] >= 0
    return opened


@numba.njit(cache=True)
def _allow(rules, state, i, most, allowed):
    """Fill `allowed`, bool (tokens,), for a string of at most `most` tokens."""
    first = len(rules.counted) + 3
    free = -1
    _find_witnesses(rules, state, i)
    for token in range(len(allowed)):
        is_free = token >= first and state.opened[i, token - first] < 0
        if is_free and free >= 0:
            allowed[token] = allowed[free]  # one free number is as good as another
            continue
        allowed[token] = _may_come(rules, state, i, most, token)
        if is_free:
            free = token


@numba.njit(cache=True)
def _choose(rules, state, i, most, scores):
    """The token of the highest score that may come next, or NONE; scores of those before it become -inf."""
    _find_witnesses(rules, state, i)
    while True:
        token = int(scores.argmax())
        if scores[token] == -np.inf:
            return NO_TOKEN
        if _may_come(rules, state, i, most, token):
            return token
        scores[token] = -np.inf


@numba.njit(cache=True)
def _take(rules, state, i, token):
    """Append an allowed token."""
    types = len(rules.counted)
    if token == END_TOKEN:
        state.previous[i] = _ENDED
        return
    state.length[i] += 1
    current = state.current[i]
    if token <= types:
        _add_node(rules, state, i, token - 1)
        _forget_witnesses(state, i, current, current)
    elif token == types + 1:
        state.stack[i, state.depth[i]] = current
        state.depth[i] += 1
        state.previous[i] = _OPEN
    elif token == types + 2:
        state.left[i, current] = True
        _update(rules, state, i, current)
        _forget_witnesses(state, i, current, current)
        state.depth[i] -= 1
        state.current[i] = state.stack[i, state.depth[i]]
        state.previous[i] = _CLOSE
    else:
        k = token - types - 3
        origin = state.opened[i, k]
        if origin >= 0:
            _close_cycle(rules, state, i, k)
        else:
            state.pending[i, current] += 1
            state.opened[i, k] = current
            _update(rules, state, i, current)
        _forget_witnesses(state, i, origin, current)


@numba.njit(cache=True)
def _allow_all(rules, state, most, allowed):
    for i in range(len(allowed)):
        _allow(rules, state, i, most, allowed[i])


@numba.njit(cache=True)
def _choose_all(rules, state, most, scores, kept, tokens):
    for i in range(len(tokens)):
        tokens[i] = kept[i] if kept[i] != NO_TOKEN else _choose(rules, state, i, most, scores[i])


@numba.njit(cache=True)
def _take_all(rules, state, tokens):
    for i in range(len(tokens)):
        if state.previous[i] != _ENDED:
            _take(rules, state, i, tokens[i])


@numba.njit(cache=True)
def _is_followed(rules, state, i, most, tokens):
    # Row and room are arguments: constants have a type of their own, for which all that is called would be compiled
    # once more.
    for place in range(len(tokens)):
        _find_witnesses(rules, state, i)
        if not _may_come(rules, state, i, most, tokens[place]):
            return False
        _take(rules, state, i, tokens[place])
    return True


@numba.njit(cache=True)
def _follow(rules, state, i, most, tokens, allowed):
    """The masks along a string of at most `most` tokens, and the most that any beginning of it needs to end without
    more cycles: -1 where the string has a token that is not allowed."""
    needed = 0
    for place in range(len(tokens)):
        _allow(rules, state, i, most, allowed[place])
        if not allowed[place, tokens[place]]:
            return -1
        _take(rules, state, i, tokens[place])
        if state.previous[i] != _OPEN and state.previous[i] != _ENDED:
            total = state.length[i] + state.need[i, state.current[i]] + _open_cycles(state, i)
            for d in range(state.depth[i]):
                total += state.need[i, state.stack[i, d]] + 1
            needed = max(needed, total)
    return needed


class GrammarMask:
    """The beginnings of some strings, all of which grow by one token at a time."""

    def __init__(self, rules: CompiledGrammar, cycles: int, strings: int, most: int) -> None:
        """`strings` empty beginnings of strings with the cycle numbers below `cycles` and at most `most` tokens."""
        types = len(rules.counted)
        shape = (strings, most + 1)
        self._rules, self._most = rules, most
        self.tokens = types + 3 + cycles
        self._state = _State(
            kind=np.zeros(shape, np.int16),
            parent=np.full(shape, -1, np.int32),
            counts=np.zeros((*shape, types), np.int16),
            pending=np.zeros(shape, np.int16),
            need=np.zeros(shape, np.int64),
            left=np.zeros(shape, np.bool_),
            stack=np.zeros(shape, np.int32),
            depth=np.zeros(strings, np.int32),
            current=np.full(strings, -1, np.int32),
            previous=np.full(strings, _START, np.int8),
            nodes=np.zeros(strings, np.int32),
            length=np.zeros(strings, np.int32),
            opened=np.full((strings, cycles), -1, np.int32),
            witness=np.full((strings, cycles), NO_TOKEN, np.int32),
            partners=np.zeros(shape, np.int32),
            closed=np.zeros(strings, np.int32),
        )

    def allowed(self) -> npt.NDArray[np.bool_]:
        """Which tokens may come next, bool (strings, tokens); of a string that has ended, its end."""
        allowed = np.empty((len(self._state.depth), self.tokens), np.bool_)
        _allow_all(self._rules, self._state, self._most, allowed)
        return allowed

    def choose(self, scores: npt.NDArray[np.float64], kept: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
        """The token of the highest score, float64 (strings, tokens), that may come next in each string, or NONE where
        none may that has a score above -inf; the scores are used up. Where `kept`, int64 (strings,), is a token and
        not NONE, it is that one, unasked. Far fewer tokens are looked at than for `allowed`."""
        tokens = np.empty(len(scores), np.int64)
        _choose_all(self._rules, self._state, self._most, scores, kept, tokens)
        return tokens

    def take(self, tokens: npt.NDArray[np.int64]) -> None:
        """Append an allowed token, int64 (strings,), to each string that has not ended."""
        _take_all(self._rules, self._state, tokens)


def follows_grammar(rules: CompiledGrammar, cycles: int, tokens: npt.NDArray[np.int64]) -> bool:
    """Whether each token of a whole string, int64 (n,), END among them, is allowed after those before it."""
    return bool(_is_followed(rules, GrammarMask(rules, cycles, 1, len(tokens))._state, 0, NO_COMPLETION, tokens))


def masks_along(
    rules: CompiledGrammar, cycles: int, tokens: npt.NDArray[np.int64]
) -> tuple[npt.NDArray[np.bool_], int]:
    """What was allowed at each token of a whole string, END among them, bool (n, tokens); and how many tokens a string
    that begins as this one does at any place may need, if it takes the shortest way to its end from there.

    Raises ValueError for a string with a token that is not allowed.
    """
    beginning = GrammarMask(rules, cycles, 1, len(tokens))
    allowed = np.zeros((len(tokens), beginning.tokens), np.bool_)
    most = int(_follow(rules, beginning._state, 0, NO_COMPLETION, tokens, allowed))
    if most < 0:
        place = int(np.argmax(~allowed.any(axis=1) | ~allowed[np.arange(len(tokens)), tokens]))
        raise ValueError(f"token {place} is not allowed there by the grammar")
    return allowed, most
