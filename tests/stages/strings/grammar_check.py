"""Checks strings against the tiling grammar of a kit (strings §3, §5.1)."""

from __future__ import annotations

from collections import Counter
from itertools import combinations

from stages.shape.graphs.neighbourhoods import SLOT_LEVELS, admits
from stages.shape.kit import Grammar, Multiset
from stages.strings.decoder import Decoded, decode
from stages.strings.settings import Edges
from stages.strings.tokens import Alphabet, StringError


def check_string(string: str, alphabet: Alphabet, grammar: Grammar, edges: Edges = "all") -> Decoded:
    """Decode a string whose nodes all have neighbourhoods that the grammar admits.

    If strings have some contacts only (`edges`), a node may have others. Raises StringError for a string that cannot be
    decoded, at the first edge of two types that are never neighbours, or at the first refused neighbourhood.
    """
    decoded = decode(string, alphabet)
    types = decoded.types.tolist()
    around = {
        kind: {other for multiset in multisets for other, _ in multiset}
        for kind, multisets in grammar.neighbourhoods.items()
    }
    for docking in grammar.dockings:
        if docking.a in grammar.hubs or docking.b in grammar.hubs:
            around.setdefault(docking.a, set()).add(docking.b)
            around.setdefault(docking.b, set()).add(docking.a)
    pairs = decoded.edges.tolist()
    neighbours: list[list[int]] = [[] for _ in types]
    for i, j in pairs:
        neighbours[i].append(types[j])
        neighbours[j].append(types[i])
    for token in decoded.tokens:
        if token.edge >= 0:
            i, j = pairs[token.edge]
            if types[j] not in around.get(types[i], ()):
                pair = f"{alphabet.tokens[types[i]]} ({alphabet.names[types[i]]}) and {alphabet.tokens[types[j]]} "
                raise StringError(string, token.index, f"{pair}({alphabet.names[types[j]]}) are never neighbours")
    for token in decoded.tokens:
        if token.kind == "node":
            counts = Counter(neighbours[token.node])
            multiset = tuple(sorted(counts.items()))
            if not (admits if edges == "all" else admits_superset)(grammar, types[token.node], multiset):
                seen = ", ".join(f"{count} {alphabet.tokens[kind]}" for kind, count in multiset) or "no neighbour"
                raise StringError(string, token.index, f"{token.text} {_verdict(grammar)} with {seen} around it")
    return decoded


def admits_superset(grammar: Grammar, part_type: int, neighbours: Multiset) -> bool:
    """Return whether a part of type `part_type` may have these `neighbours`, possibly with others.

    This is what a graph that leaves out contacts can show.
    """
    if part_type in grammar.hubs:
        return True
    counts = {other: count for other, count in neighbours if other not in grammar.hubs}
    total = sum(counts.values())
    observed = grammar.neighbourhoods.get(part_type, {})
    if grammar.strictness == "multiset":
        return any(
            all(dict(multiset).get(other, 0) >= count for other, count in counts.items()) for multiset in observed
        )
    if grammar.strictness == "count_and_set":
        # each observed type is there at least once, so that many places are left
        return any(
            counts.keys() <= dict(multiset).keys()
            and sum(max(counts.get(other, 0), 1) for other, _ in multiset) <= _size(multiset)
            for multiset in observed
        )
    if not counts.keys() <= {other for multiset in observed for other, _ in multiset}:
        return False
    if grammar.strictness in SLOT_LEVELS:
        return True
    if not any(total <= _size(multiset) for multiset in observed):
        return False
    if grammar.strictness == "count_and_types":
        return True
    together = {pair for multiset in observed for pair in combinations([other for other, _ in multiset], 2)}
    return all(pair in together for pair in combinations(sorted(counts), 2))


def _size(multiset: Multiset) -> int:
    return sum(count for _, count in multiset)


def _verdict(grammar: Grammar) -> str:
    return "was never seen" if grammar.strictness == "multiset" else f"is not allowed by {grammar.strictness}"
