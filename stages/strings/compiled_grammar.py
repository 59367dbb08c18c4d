"""Compiles a tiling grammar to patterns of complete neighbourhoods (strings §3).

Every level of strictness becomes patterns. A node is complete if its neighbours fit a pattern of its type: of each
neighbour type at least `low` and at most `high`, and `size` in all, without hubs.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import combinations
from typing import Any

import numpy as np

from stages.shape.graphs.neighbourhoods import SLOT_LEVELS
from stages.shape.kit import Grammar, Multiset
from stages.strings.grammar_arrays import ANY_SIZE, MAX_NEIGHBOURS, NO_COMPLETION, CompiledGrammar

Pattern = tuple[dict[int, int], dict[int, int], int]
"""Least and most neighbours by type, and their number."""


def compile_grammar(grammar: Grammar, types: int, cycles: int, partial: bool = False) -> CompiledGrammar:
    """Compile a grammar with some number of types, for strings with cycle numbers below `cycles`.

    partial: strings have some contacts only, so a node may have more neighbours (`admits_more`).
    """
    near_hub = _hub_pairs(grammar)
    first, low, high, size = [0], [], [], []
    for kind in range(types):
        for lows, highs, total in _patterns(grammar, kind, near_hub):
            low.append([lows.get(other, 0) for other in range(types)])
            high.append([highs.get(other, 0) for other in range(types)])
            size.append(total)
        first.append(len(low))
    counted = [kind not in grammar.hubs for kind in range(types)]
    patterns = {"first": first, "low": low, "high": high, "size": size, "counted": counted, "partial": partial}
    return compile_patterns(patterns, cycles)


def compile_patterns(patterns: Mapping[str, Any], cycles: int) -> CompiledGrammar:
    """Compile the result of `patterns_json`, for strings with cycle numbers below `cycles`."""
    counted = np.array(patterns["counted"], dtype=np.bool_)
    types = len(counted)
    high = np.array(patterns["high"], dtype=np.int64).reshape(-1, types)
    empty = np.zeros((0, 0), dtype=np.bool_)
    rules = CompiledGrammar(
        first=np.array(patterns["first"], dtype=np.int64),
        low=np.array(patterns["low"], dtype=np.int64).reshape(-1, types),
        high=high,
        size=np.array(patterns["size"], dtype=np.int64),
        loose=np.asarray((high[:, ~counted] > 0).any(axis=1)),
        counted=counted,
        partial=bool(patterns["partial"]),
        cost=np.full((types, types), NO_COMPLETION, dtype=np.int64),
        arc=np.full((types, types), -1, dtype=np.int64),
        closes=empty,
        closes_below=empty,
    )
    return _with_consequences(rules, types, cycles)


def patterns_json(grammar: CompiledGrammar) -> dict[str, Any]:
    """Return the patterns as JSON."""
    arrays = {name: getattr(grammar, name).tolist() for name in ("first", "low", "high", "size", "counted")}
    return {**arrays, "partial": grammar.partial}


def _hub_pairs(grammar: Grammar) -> set[tuple[int, int]]:
    """Return pairs of types, in both orders, that dock and include a hub."""
    pairs = {(docking.a, docking.b) for docking in grammar.dockings if {docking.a, docking.b} & set(grammar.hubs)}
    return pairs | {(b, a) for a, b in pairs}


def _patterns(grammar: Grammar, kind: int, near_hub: set[tuple[int, int]]) -> Iterator[Pattern]:
    """Yield the patterns of a type."""
    hubs = {other: MAX_NEIGHBOURS for own, other in sorted(near_hub) if own == kind}
    if kind in grammar.hubs:
        yield {}, hubs, ANY_SIZE
        return
    observed = list(grammar.neighbourhoods.get(kind, {}))
    around = sorted({other for multiset in observed for other, _ in multiset})
    sizes = sorted({_size(multiset) for multiset in observed})
    if grammar.strictness == "multiset":
        for multiset in observed:
            yield dict(multiset), {**hubs, **dict(multiset)}, _size(multiset)
    elif grammar.strictness == "count_and_set":
        for multiset in observed:
            size = _size(multiset)
            yield {other: 1 for other, _ in multiset}, {**hubs, **{other: size for other, _ in multiset}}, size
    elif grammar.strictness in SLOT_LEVELS:
        yield {}, {**hubs, **dict.fromkeys(around, MAX_NEIGHBOURS)}, ANY_SIZE
    else:
        together = [around] if grammar.strictness == "count_and_types" else _seen_together(observed, around)
        for size in sizes:
            for types in together:
                yield {}, {**hubs, **dict.fromkeys(types, size)}, size


def _seen_together(observed: list[Multiset], around: list[int]) -> list[list[int]]:
    """Return the maximal sets of types that occur pairwise in one multiset."""
    import networkx as nx

    together = nx.Graph()
    together.add_nodes_from(around)
    together.add_edges_from(pair for multiset in observed for pair in combinations([other for other, _ in multiset], 2))
    return sorted(sorted(clique) for clique in nx.find_cliques(together)) if around else [[]]


def _with_consequences(rules: CompiledGrammar, types: int, cycles: int) -> CompiledGrammar:
    """Return the grammar with what follows from its patterns: neighbour pairs, costs, and where cycles can close."""
    from stages.strings.completion import tokens_to_complete

    def completed(kind: int, *neighbours: int) -> int:
        counts = np.bincount(np.array(neighbours, dtype=np.int64), minlength=types)
        return int(tokens_to_complete(rules, kind, counts, 0, False))

    rules.cost[:] = 0
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


def _size(multiset: Multiset) -> int:
    return sum(count for _, count in multiset)
