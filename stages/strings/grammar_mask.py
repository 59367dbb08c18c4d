"""The grammar mask: tokens that can follow a prefix so that a string of the tiling grammar can still result.

A token is refused if no string with the new prefix is well-formed (`stages.strings.decoder`) and admitted
(`stages.shape.graphs.neighbourhoods`), as far as each node tells by itself: its neighbours fit a pattern of its type,
and one of its subtrees can hold the other end of each open cycle. A token of an admitted string is refused only for
want of room: everything open must be closed within the tokens left, cycles by numbers and nodes by subtrees without
cycles.

Without open cycles every allowed prefix can be completed. Several open cycles may each be closable, but not together;
then no token may be left, and the caller must backtrack.

Numba compiles this module when it is imported: import it inside functions.
"""

from __future__ import annotations

import numba
import numpy as np
import numpy.typing as npt

from stages.strings.compiled_grammar import CompiledGrammar
from stages.strings.completion import NO_COMPLETION
from stages.strings.cycle_certificates import can_complete, find_certificates, forget_certificates
from stages.strings.mask_state import (
    CLOSE,
    END_TOKEN,
    ENDED,
    NODE,
    OPEN,
    START,
    add_node,
    can_leave,
    close_cycle,
    empty_state,
    not_joined,
    open_cycles,
    remove_node,
    update_need,
)

NO_TOKEN = -1


@numba.njit(cache=True)
def _allows_node(grammar, state, i, kind, tokens):
    """Return whether a node can follow, with `tokens` left after it."""
    parent, previous, joins = state.current[i], state.previous[i], state.joins[i]
    if previous != START and grammar.arc[state.kind[i, parent], kind] < 0:
        return False
    need = state.need[i, parent] if previous != START else 0
    allowed = add_node(grammar, state, i, kind) and can_complete(grammar, state, i, tokens, parent, parent)
    remove_node(state, i, previous, need, joins)
    return allowed


@numba.njit(cache=True)
def _allows_number(grammar, state, i, k, tokens):
    """Return whether cycle number k can follow, with `tokens` left after it."""
    current, origin = state.current[i], state.opened[i, k]
    need = state.need[i, current]
    if origin < 0:
        state.pending[i, current] += 1
        state.opened[i, k] = current
        allowed = update_need(grammar, state, i, current) and can_complete(grammar, state, i, tokens, current, current)
        state.pending[i, current] -= 1
        state.opened[i, k] = -1
        state.need[i, current] = need
        return allowed
    if grammar.arc[state.kind[i, origin], state.kind[i, current]] < 0 or not not_joined(state, i, origin):
        return False
    needed = state.need[i, origin]
    allowed = close_cycle(grammar, state, i, k) and can_complete(grammar, state, i, tokens, origin, current)
    state.joins[i] -= 1
    state.counts[i, origin, state.kind[i, current]] -= 1
    state.counts[i, current, state.kind[i, origin]] -= 1
    state.pending[i, origin] += 1
    state.opened[i, k] = origin
    state.need[i, origin], state.need[i, current] = needed, need
    return allowed


@numba.njit(cache=True)
def _allows_branch(grammar, state, i, tokens):
    """Return whether a branch can begin: some node can follow in it."""
    types = len(grammar.counted)
    previous, current = state.previous[i], state.current[i]
    state.stack[i, state.depth[i]] = current
    state.depth[i] += 1
    state.previous[i] = OPEN
    allowed = False
    for kind in range(types):
        if _allows_node(grammar, state, i, kind, tokens - 1):
            allowed = True
            break
    state.depth[i] -= 1
    state.previous[i] = previous
    return allowed


@numba.njit(cache=True)
def _allows_branch_end(grammar, state, i, tokens):
    """Return whether the current branch can end."""
    node = state.current[i]
    previous = state.previous[i]
    state.depth[i] -= 1
    state.current[i] = state.stack[i, state.depth[i]]
    state.previous[i] = CLOSE
    allowed = can_complete(grammar, state, i, tokens, node, node)
    state.depth[i] += 1
    state.current[i] = node
    state.previous[i] = previous
    return allowed


@numba.njit(cache=True)
def _allows(grammar, state, i, max_tokens, token):
    """Return whether a token can follow in a string of at most `max_tokens` tokens."""
    types = len(grammar.counted)
    previous = state.previous[i]
    if previous == ENDED:
        return token == END_TOKEN
    tokens = max_tokens - state.length[i] - 1
    if 1 <= token <= types:
        return tokens >= 0 and _allows_node(grammar, state, i, token - 1, tokens)
    if previous in (START, OPEN):
        return False
    if token == END_TOKEN:
        return state.depth[i] == 0 and open_cycles(state, i) == 0 and can_leave(grammar, state, i)
    if tokens < 0:
        return False
    if token == types + 1:
        return _allows_branch(grammar, state, i, tokens)
    if token == types + 2:
        return state.depth[i] > 0 and can_leave(grammar, state, i) and _allows_branch_end(grammar, state, i, tokens)
    return previous == NODE and _allows_number(grammar, state, i, token - types - 3, tokens)


@numba.njit(cache=True)
def _fill_mask(grammar, state, i, max_tokens, allowed):
    """Fill the mask of a string, bool (tokens,)."""
    first = len(grammar.counted) + 3
    free = -1
    find_certificates(grammar, state, i)
    for token in range(len(allowed)):
        is_free = token >= first and state.opened[i, token - first] < 0
        if is_free and free >= 0:
            allowed[token] = allowed[free]  # one free number is as good as another
            continue
        allowed[token] = _allows(grammar, state, i, max_tokens, token)
        if is_free:
            free = token


@numba.njit(cache=True)
def _choose(grammar, state, i, max_tokens, scores):
    """Return the allowed token with the highest score, or NO_TOKEN; scores of refused tokens become -inf."""
    find_certificates(grammar, state, i)
    while True:
        token = int(scores.argmax())
        if scores[token] == -np.inf:
            return NO_TOKEN
        if _allows(grammar, state, i, max_tokens, token):
            return token
        scores[token] = -np.inf


@numba.njit(cache=True)
def take_token(grammar, state, i, token):
    """Append an allowed token."""
    types = len(grammar.counted)
    if token == END_TOKEN:
        state.previous[i] = ENDED
        return
    state.length[i] += 1
    current = state.current[i]
    if token <= types:
        add_node(grammar, state, i, token - 1)
        forget_certificates(state, i, current, current)
    elif token == types + 1:
        state.stack[i, state.depth[i]] = current
        state.depth[i] += 1
        state.previous[i] = OPEN
    elif token == types + 2:
        state.finished[i, current] = True
        update_need(grammar, state, i, current)
        forget_certificates(state, i, current, current)
        state.depth[i] -= 1
        state.current[i] = state.stack[i, state.depth[i]]
        state.previous[i] = CLOSE
    else:
        k = token - types - 3
        origin = state.opened[i, k]
        if origin >= 0:
            close_cycle(grammar, state, i, k)
        else:
            state.pending[i, current] += 1
            state.opened[i, k] = current
            update_need(grammar, state, i, current)
        forget_certificates(state, i, origin, current)


@numba.njit(cache=True)
def _fill_masks(grammar, state, max_tokens, allowed):
    for i in range(len(allowed)):
        _fill_mask(grammar, state, i, max_tokens, allowed[i])


@numba.njit(cache=True)
def _choose_tokens(grammar, state, max_tokens, scores, kept, tokens):
    for i in range(len(tokens)):
        tokens[i] = kept[i] if kept[i] != NO_TOKEN else _choose(grammar, state, i, max_tokens, scores[i])


@numba.njit(cache=True)
def _take_tokens(grammar, state, tokens):
    for i in range(len(tokens)):
        if state.previous[i] != ENDED:
            take_token(grammar, state, i, tokens[i])


@numba.njit(cache=True)
def _follows(grammar, state, i, max_tokens, tokens):
    # `i` and `max_tokens` are arguments: for constants, which have their own types, callees would be compiled again.
    for index in range(len(tokens)):
        find_certificates(grammar, state, i)
        if not _allows(grammar, state, i, max_tokens, tokens[index]):
            return False
        take_token(grammar, state, i, tokens[index])
    return True


@numba.njit(cache=True)
def _fill_masks_along(grammar, state, i, max_tokens, tokens, allowed):
    """Fill the masks along a string; return the most tokens that any prefix needs to end, or -1 if it is refused."""
    needed = 0
    for index in range(len(tokens)):
        _fill_mask(grammar, state, i, max_tokens, allowed[index])
        if not allowed[index, tokens[index]]:
            return -1
        take_token(grammar, state, i, tokens[index])
        if state.previous[i] != OPEN and state.previous[i] != ENDED:
            total = state.length[i] + state.need[i, state.current[i]] + open_cycles(state, i)
            for d in range(state.depth[i]):
                total += state.need[i, state.stack[i, d]] + 1
            needed = max(needed, total)
    return needed


class GrammarMask:
    """The prefixes of some strings, which grow by one token at a time."""

    def __init__(self, grammar: CompiledGrammar, cycles: int, strings: int, max_tokens: int) -> None:
        """Start `strings` empty prefixes with cycle numbers below `cycles` and at most `max_tokens` tokens."""
        types = len(grammar.counted)
        self._grammar, self._max_tokens = grammar, max_tokens
        self.tokens = types + 3 + cycles
        self.state = empty_state(strings, max_tokens, types, cycles)

    def allowed(self) -> npt.NDArray[np.bool_]:
        """Return the masks of the next tokens, bool (strings, tokens); of an ended string, its end alone."""
        allowed = np.empty((len(self.state.depth), self.tokens), np.bool_)
        _fill_masks(self._grammar, self.state, self._max_tokens, allowed)
        return allowed

    def choose(self, scores: npt.NDArray[np.float64], kept: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
        """Return the allowed token with the highest score for each string, int64 (strings,).

        scores: float64 (strings, tokens), overwritten; NO_TOKEN results if no allowed token has a score above -inf.
        kept: int64 (strings,), tokens to return without a check, or NO_TOKEN. Far fewer tokens are checked than for
        `allowed`.
        """
        tokens = np.empty(len(scores), np.int64)
        _choose_tokens(self._grammar, self.state, self._max_tokens, scores, kept, tokens)
        return tokens

    def take(self, tokens: npt.NDArray[np.int64]) -> None:
        """Append an allowed token, int64 (strings,), to each string that has not ended."""
        _take_tokens(self._grammar, self.state, tokens)


def follows_grammar(grammar: CompiledGrammar, cycles: int, tokens: npt.NDArray[np.int64]) -> bool:
    """Return whether each token of a whole string, int64 (n,), with its END_TOKEN, is allowed after those before it."""
    return bool(_follows(grammar, GrammarMask(grammar, cycles, 1, len(tokens)).state, 0, NO_COMPLETION, tokens))


def masks_along(
    grammar: CompiledGrammar, cycles: int, tokens: npt.NDArray[np.int64]
) -> tuple[npt.NDArray[np.bool_], int]:
    """Return the mask at each token of a whole string, bool (n, tokens), and the tokens that its prefixes may need.

    The number is the most that any prefix of the string has if it ends by the shortest way. Raises ValueError for a
    token that is not allowed.
    """
    mask = GrammarMask(grammar, cycles, 1, len(tokens))
    allowed = np.zeros((len(tokens), mask.tokens), np.bool_)
    needed = int(_fill_masks_along(grammar, mask.state, 0, NO_COMPLETION, tokens, allowed))
    if needed < 0:
        index = int(np.argmax(~allowed.any(axis=1) | ~allowed[np.arange(len(tokens)), tokens]))
        raise ValueError(f"token {index} is not allowed there by the grammar")
    return allowed, needed
