"""The tiling grammar as arrays: which neighbours complete a node, and what it takes to get there (strings §3).

Every level of strictness becomes patterns. A node of a type is complete when its neighbours fit one pattern of the
type: of each neighbour type at least `low` and at most `high`, and `size` in all, hubs not counted.
"""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Iterator, Mapping
from itertools import combinations
from typing import Any

import numpy as np

from stages.shape.graphs.neighbourhoods import SLOT_LEVELS
from stages.shape.kit import Grammar, Multiset

ANY_SIZE = -1
"""Size of a pattern that any number of neighbours fits."""
MAX_NEIGHBOURS = 1 << 14
"""As many neighbours of a type as there may be."""
NO_COMPLETION = 1 << 28
"""Tokens to the end of what has no end."""

CompiledGrammar = namedtuple(
    "CompiledGrammar", "first low high size loose counted partial cost arc closes closes_below"
)
"""Arrays, for compiled code.

first: int64 (types + 1,), the patterns of type t are rows first[t] to first[t + 1]; low, high: int64 (patterns, types);
size: int64 (patterns,), or ANY; loose: bool (patterns,), whether uncounted neighbours fit it besides; counted: bool
(types,), whether neighbours of a type count, which hubs do not; partial: whether a node is complete with less, as long
as the rest may be there besides.
cost: int64 (types, types), the fewest tokens of a subtree whose root is a `column` that hangs on a `row`; where none
ends without a cycle 1, or NEVER for strings without cycles.
arc: int64 (types, types), number of the pair of neighbour types (row, column), or -1.
closes: bool (arcs, arcs), whether the subtree of the first pair's second type, hung on its first, can hold a node of
the second pair's second type where a cycle edge from its first ends; closes_below: the same without the subtree's root.
"""

Pattern = tuple[dict[int, int], dict[int, int], int]


def compile_grammar(grammar: Grammar, types: int, cycles: int, partial: bool = False) -> CompiledGrammar:
    """The rules of a grammar of so many types, for strings with so many cycle numbers.

    `partial`: strings do not tell of all contacts, so that a node may have neighbours besides (`admits_more`).
    """
    beside_hub = _beside_hubs(grammar)
    first, low, high, size = [0], [], [], []
    for kind in range(types):
        for lows, highs, total in _patterns(grammar, kind, beside_hub):
            low.append([lows.get(other, 0) for other in range(types)])
            high.append([highs.get(other, 0) for other in range(types)])
            size.append(total)
        first.append(len(low))
    counted = [kind not in grammar.hubs for kind in range(types)]
    patterns = {"first": first, "low": low, "high": high, "size": size, "counted": counted, "partial": partial}
    return compile_patterns(patterns, cycles)


def compile_patterns(patterns: Mapping[str, Any], cycles: int) -> CompiledGrammar:
    """The rules of what `patterns_json` answers, for strings with so many cycle numbers."""
    counted = np.array(patterns["counted"], dtype=np.bool_)
    types = len(counted)
    high = np.array(patterns["high"], dtype=np.int64).reshape(-1, types)
    empty = np.zeros((0, 0), dtype=np.bool_)
    rules = CompiledGrammar(
        first=np.array(patterns["first"], dtype=np.int64),
        low=np.array(patterns["low"], dtype=np.int64).reshape(-1, types),
        high=high,
        size=np.array(patterns["size"], dtype=np.int64),
        loose=(high[:, ~counted] > 0).any(axis=1),
        counted=counted,
        partial=bool(patterns["partial"]),
        cost=np.full((types, types), NO_COMPLETION, dtype=np.int64),
        arc=np.full((types, types), -1, dtype=np.int64),
        closes=empty,
        closes_below=empty,
    )
    return _reached(rules, types, cycles)


def patterns_json(rules: CompiledGrammar) -> dict[str, Any]:
    """What rules are made of, as JSON."""
    arrays = {name: getattr(rules, name).tolist() for name in ("first", "low", "high", "size", "counted")}
    return {**arrays, "partial": rules.partial}


def _beside_hubs(grammar: Grammar) -> set[tuple[int, int]]:
    """Pairs of types of which one is a hub, and that dock, both ways round."""
    pairs = {(each.a, each.b) for each in grammar.dockings if {each.a, each.b} & set(grammar.hubs)}
    return pairs | {(b, a) for a, b in pairs}


def _patterns(grammar: Grammar, kind: int, beside_hub: set[tuple[int, int]]) -> Iterator[Pattern]:
    """The patterns of a type: least and greatest counts by neighbour type, and the number of neighbours."""
    hubs = {other: MAX_NEIGHBOURS for each, other in sorted(beside_hub) if each == kind}
    if kind in grammar.hubs:
        yield {}, hubs, ANY_SIZE
        return
    observed = list(grammar.neighbourhoods.get(kind, {}))
    around = sorted({other for each in observed for other, _ in each})
    sizes = sorted({_size(each) for each in observed})
    if grammar.strictness == "multiset":
        for each in observed:
            yield dict(each), {**hubs, **dict(each)}, _size(each)
    elif grammar.strictness == "count_and_set":
        for each in observed:
            yield {other: 1 for other, _ in each}, {**hubs, **{other: _size(each) for other, _ in each}}, _size(each)
    elif grammar.strictness in SLOT_LEVELS:
        yield {}, {**hubs, **dict.fromkeys(around, MAX_NEIGHBOURS)}, ANY_SIZE
    else:
        together = [around] if grammar.strictness == "count_and_types" else _seen_together(observed, around)
        for size in sizes:
            for types in together:
                yield {}, {**hubs, **dict.fromkeys(types, size)}, size


def _seen_together(observed: list[Multiset], around: list[int]) -> list[list[int]]:
    """The greatest sets of types of which each two stand in one of the multisets."""
    import networkx as nx

    together = nx.Graph()
    together.add_nodes_from(around)
    together.add_edges_from(pair for each in observed for pair in combinations([other for other, _ in each], 2))
    return sorted(sorted(clique) for clique in nx.find_cliques(together)) if around else [[]]


def _reached(rules: CompiledGrammar, types: int, cycles: int) -> CompiledGrammar:
    """The rules with what follows from the patterns: pairs of neighbours, costs, and where cycles can close."""
    from stages.strings.grammar_mask import tokens_to_complete

    def completed(kind: int, *neighbours: int) -> int:
        counts = np.bincount(np.array(neighbours, dtype=np.int64), minlength=types)
        return int(tokens_to_complete(rules, kind, counts, 0, False))

    rules.cost[:] = 0
    beside = np.array(
        [[completed(kind, other) < NO_COMPLETION for other in range(types)] for kind in range(types)], np.bool_
    )
    pairs = [(a, b) for a in range(types) for b in range(types) if beside[a, b] and beside[b, a]]
    for number, (a, b) in enumerate(pairs):
        rules.arc[a, b] = number
    with_both = np.zeros((len(pairs), len(pairs)), dtype=np.bool_)
    for place, (a, b) in enumerate(pairs):
        for other, (c, d) in enumerate(pairs):
            with_both[place, other] = b == d and completed(b, a, c) < NO_COMPLETION
    # with_both[a -> b, c -> b]: a node of type b may stand beside an a and a c
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
    # below[a -> b, b -> c]: a b that hangs on an a may have a child of type c
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
