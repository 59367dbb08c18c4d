"""Which neighbours a part may have: the neighbourhoods that a grammar admits, by its strictness (strings §3).

Each level admits all that the one before it admits:

- `multiset`: the multisets of neighbour types observed around the part's type;
- `count_and_set`: as many neighbours, of the same set of types, as in one observed multiset; the number of each type is
  free but not zero;
- `count_and_pairs`: as many neighbours as some observed multiset, of types such that each was observed around the
  part's type and each two of them around one part of it;
- `count_and_types`: as many neighbours as some observed multiset, of types that were each observed around the part's
  type. This is the published rule.

The levels of slots need poses (`stages.shape.graphs.slots`). A shape's graph alone shows only that each neighbour's
type was observed around the part's type.

Hub types are exempt: a hub may have any neighbours, and hubs do not count among the neighbours of other parts.
"""

from __future__ import annotations

from itertools import combinations

from stages.shape.kit import Grammar, Multiset, Strictness

STRICTNESS: tuple[Strictness, ...] = ("multiset", "count_and_set", "count_and_pairs", "count_and_types")
"""The levels without slots, the strictest first."""
SLOT_LEVELS: tuple[Strictness, ...] = ("slot_pairs", "slot_fillings", "slots")
"""The levels of slots, the strictest first."""


def admits(grammar: Grammar, part_type: int, neighbours: Multiset) -> bool:
    """Return whether a part of type `part_type` may have these `neighbours`, hubs among them ignored."""
    if part_type in grammar.hubs:
        return True
    counted = tuple((other, count) for other, count in neighbours if other not in grammar.hubs)
    observed = grammar.neighbourhoods.get(part_type, {})
    if grammar.strictness == "multiset":
        return counted in observed
    total, types = _size(counted), {other for other, _ in counted}
    if grammar.strictness == "count_and_set":
        return any(total == _size(multiset) and types == {other for other, _ in multiset} for multiset in observed)
    if not types <= {other for multiset in observed for other, _ in multiset}:
        return False
    if grammar.strictness in SLOT_LEVELS:
        return True
    if total not in {_size(multiset) for multiset in observed}:
        return False
    if grammar.strictness == "count_and_types":
        return True
    together = {pair for multiset in observed for pair in combinations([other for other, _ in multiset], 2)}
    return all(pair in together for pair in combinations(sorted(types), 2))


def _size(multiset: Multiset) -> int:
    return sum(count for _, count in multiset)
