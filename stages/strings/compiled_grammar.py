"""A tiling grammar for the grammar mask: its patterns, and what follows from them for strings (strings §3)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from stages.shape.graphs.grammar_patterns import GrammarPatterns, grammar_patterns
from stages.shape.kit import Grammar


class CompiledGrammar(NamedTuple):
    """The fields of GrammarPatterns, and what follows from them, as arrays for compiled code."""

    first: np.ndarray
    low: np.ndarray
    high: np.ndarray
    size: np.ndarray
    counted: np.ndarray
    loose: np.ndarray  # bool (patterns,): uncounted neighbours fit, too
    partial: bool  # strings have some contacts only: a node is complete with fewer neighbours
    cost: np.ndarray  # int64 (types, types): fewest tokens of a subtree with root `column` below a `row`
    arc: np.ndarray  # int64 (types, types): number of the pair of neighbour types (row, column), or -1
    closes: np.ndarray  # bool (arcs, arcs): the subtree below the first pair can close a cycle that is the second pair
    closes_below: np.ndarray  # bool (arcs, arcs): the same, without the root of the subtree


def compile_grammar(grammar: Grammar, types: int, cycles: int, partial: bool = False) -> CompiledGrammar:
    """Compile a grammar with some number of types, for strings with cycle numbers below `cycles`.

    partial: strings have some contacts only, so a node may have more neighbours (`admits_more`).
    """
    return _with_consequences(grammar_patterns(grammar, types), partial, cycles)


def compile_patterns(patterns: Mapping[str, Any], cycles: int) -> CompiledGrammar:
    """Compile the result of `patterns_json`, for strings with cycle numbers below `cycles`."""
    types = len(patterns["counted"])
    low, high = (np.array(patterns[name], dtype=np.int64).reshape(-1, types) for name in ("low", "high"))
    first, size = (np.array(patterns[name], dtype=np.int64) for name in ("first", "size"))
    counted = np.array(patterns["counted"], dtype=np.bool_)
    return _with_consequences(GrammarPatterns(first, low, high, size, counted), bool(patterns["partial"]), cycles)


def patterns_json(grammar: CompiledGrammar) -> dict[str, Any]:
    """Return the patterns as JSON."""
    arrays = {name: getattr(grammar, name).tolist() for name in GrammarPatterns._fields}
    return {**arrays, "partial": grammar.partial}


def _with_consequences(patterns: GrammarPatterns, partial: bool, cycles: int) -> CompiledGrammar:
    """Return patterns with what follows from them: neighbour pairs, costs, and where cycles can close."""
    from stages.strings.completion import NO_COMPLETION, tokens_to_complete

    types = len(patterns.counted)
    rules = CompiledGrammar(
        *patterns,
        loose=np.asarray((patterns.high[:, ~patterns.counted] > 0).any(axis=1)),
        partial=partial,
        cost=np.zeros((types, types), dtype=np.int64),
        arc=np.full((types, types), -1, dtype=np.int64),
        closes=np.zeros((0, 0), dtype=np.bool_),
        closes_below=np.zeros((0, 0), dtype=np.bool_),
    )

    def completed(kind: int, *neighbours: int) -> int:
        # With the types of a state of the mask, so that it is compiled once.
        counts = np.bincount(np.array(neighbours, dtype=np.int64), minlength=types).astype(np.int16)
        return int(tokens_to_complete(rules, np.int16(kind), counts, np.int16(0), False))

    adjacent = np.array(
        [[completed(kind, other) < NO_COMPLETION for other in range(types)] for kind in range(types)], np.bool_
    )
    pairs = [(a, b) for a in range(types) for b in range(types) if adjacent[a, b] and adjacent[b, a]]
    for number, (a, b) in enumerate(pairs):
        rules.arc[a, b] = number
    with_both = np.zeros((len(pairs), len(pairs)), dtype=np.bool_)
    for first, (a, b) in enumerate(pairs):
        for second, (c, d) in enumerate(pairs):
            with_both[first, second] = b == d and completed(b, a, c) < NO_COMPLETION
    # with_both[a -> b, c -> b]: a node of type b may have neighbours a and c
    rules.cost[:] = NO_COMPLETION
    while True:
        before = rules.cost.copy()
        for parent, child in pairs:
            rules.cost[parent, child] = min(1 + completed(child, parent), NO_COMPLETION)
        if (before == rules.cost).all():
            break
    if cycles:
        rules.cost[rules.cost >= NO_COMPLETION] = 1
    mirrored = np.array([rules.arc[b, a] for a, b in pairs], dtype=np.int64)
    below = with_both[:, mirrored] if pairs else with_both
    # below[a -> b, b -> c]: a b below an a may have a child of type c
    closes = with_both.copy()
    while True:
        grown = closes | ((below.astype(np.int64) @ closes.astype(np.int64)) > 0)
        if (grown == closes).all():
            break
        closes = grown
    closes_below = (below.astype(np.int64) @ closes.astype(np.int64)) > 0
    return rules._replace(closes=closes, closes_below=closes_below)
