"""What a tiling grammar admits, as patterns of complete neighbourhoods for compiled code (strings §3).

Every level of strictness becomes patterns: the search, the grammar mask of strings and the instantiation of graphs use
the same ones. They agree with `stages.shape.graphs.neighbourhoods.admits`.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations
from typing import NamedTuple

import numba
import numpy as np

from stages.shape.graphs.neighbourhoods import SLOT_LEVELS
from stages.shape.kit import Grammar, Multiset

ANY_SIZE = -1
"""Size of a pattern that fits any number of neighbours."""
MAX_NEIGHBOURS = 1 << 14
"""Of one type."""

Pattern = tuple[dict[int, int], dict[int, int], int]
"""Least and most neighbours by type, and their number."""


class GrammarPatterns(NamedTuple):
    """The neighbourhoods that a grammar admits. A part is complete if its neighbours fit a pattern of its type."""

    first: np.ndarray  # int64 (types + 1,): the patterns of type t are rows first[t] to first[t + 1]
    low: np.ndarray  # int64 (patterns, types): least neighbours of each type
    high: np.ndarray  # int64 (patterns, types): most neighbours of each type
    size: np.ndarray  # int64 (patterns,): counted neighbours in all, or ANY_SIZE
    counted: np.ndarray  # bool (types,): neighbours of the type count; those of hubs do not


def grammar_patterns(grammar: Grammar, types: int) -> GrammarPatterns:
    """Return the patterns of a grammar with some number of types."""
    near_hub = _hub_pairs(grammar)
    first, low, high, size = [0], [], [], []
    for kind in range(types):
        for lows, highs, total in _patterns(grammar, kind, near_hub):
            low.append([lows.get(other, 0) for other in range(types)])
            high.append([highs.get(other, 0) for other in range(types)])
            size.append(total)
        first.append(len(low))
    return GrammarPatterns(
        first=np.array(first, dtype=np.int64),
        low=np.array(low, dtype=np.int64).reshape(-1, types),
        high=np.array(high, dtype=np.int64).reshape(-1, types),
        size=np.array(size, dtype=np.int64),
        counted=np.array([kind not in grammar.hubs for kind in range(types)], dtype=np.bool_),
    )


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


def _size(multiset: Multiset) -> int:
    return sum(count for _, count in multiset)


@numba.njit(cache=True)
def fits(patterns, part_type, counts, complete):
    """Return whether neighbours fit a pattern of a type; unless `complete`, together with any others.

    counts: int64 (types,), neighbours by type.
    """
    total = 0
    for kind in range(len(counts)):
        if patterns.counted[kind]:
            total += counts[kind]
    for pattern in range(patterns.first[part_type], patterns.first[part_type + 1]):
        lacking, is_within = 0, True
        for kind in range(len(counts)):
            if counts[kind] > patterns.high[pattern, kind]:
                is_within = False
                break
            lacking += max(patterns.low[pattern, kind] - counts[kind], 0)
        size = patterns.size[pattern]
        if not is_within or (complete and lacking > 0):
            continue
        if size < 0 or total + lacking == size or (not complete and total + lacking < size):
            return True
    return False
