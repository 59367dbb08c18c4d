"""Recursive rules: where one of two pieces is part of the other, an operation can be carried out upon what it has made,
again and again (substructures §4.2). It grows what it is carried out on, or, the other way round, shrinks it.
"""

from __future__ import annotations

import numpy as np

from stages.variations.substructures.ordered_graph import OrderedGraph
from stages.variations.substructures.replacement import Replacement, piece_of


def growth_of(graph: OrderedGraph, boundary: np.ndarray) -> int:
    """How many parts more there are each time that a recursive rule is carried out, fewer where it is negative; 0 where
    the operation is no such rule.

    boundary: int64 (b, 2), darts of one graph, as `Operations` says it.
    """
    taken, piece = piece_of(graph, boundary[:, 0]), piece_of(graph, boundary[:, 1])
    smaller, larger = (taken, piece) if taken.sum() < piece.sum() else (piece, taken)
    if (boundary < 0).any() or not smaller.any() or (smaller & ~larger).any():
        return 0
    return int(piece.sum()) - int(taken.sum())


def cut_again(made: Replacement, graph: OrderedGraph, boundary: np.ndarray) -> np.ndarray | None:
    """The boundary along which a rule that grows can be carried out again upon what it made, int64 (b, 2): around the
    piece that it takes out, in the copy of the one that it has put in. None where that is not whole there.

    boundary: that of the rule between two pieces of `graph`, however often it was carried out before; made: what it
    made last.
    """
    inner = graph.twins[boundary[:, 0]].tolist()
    if any(dart not in made.darts_of_giver for dart in inner):
        return None
    outer = made.graph.twins[[made.darts_of_giver[dart] for dart in inner]]
    return np.stack([outer, boundary[:, 1]], axis=1)


def cut_farther(graph: OrderedGraph, boundary: np.ndarray, cut: np.ndarray) -> np.ndarray | None:
    """The cut, int64 (b,), inside which a rule that shrinks finds what it takes out once more, so that what it would
    make upon what it has made is made at once. None where what it takes out is not there again.

    boundary: int64 (b, 2), that of the rule between two pieces of `graph`; cut: its first column at first, later what
    this found before. What lies between the two pieces, seen from the inner one, is laid upon what lies outside `cut`.
    """
    outer, inner = piece_of(graph, boundary[:, 0]), piece_of(graph, boundary[:, 1])
    between, inside = outer & ~inner, piece_of(graph, cut)
    partner: dict[int, int] = {}
    image: dict[int, int] = {}
    waiting = list(zip(boundary[:, 1].tolist(), cut.tolist(), strict=True))
    while waiting:
        dart, other = waiting.pop()
        node, place = int(graph.tails[dart]), int(graph.tails[other])
        if not between[node] or partner.get(dart, -1) == other:
            continue
        if node in image or place in image.values() or inside[place] or not _are_alike(graph, node, place):
            return None
        image[node] = place
        partner.update(zip(graph.around(dart), graph.around(other), strict=True))
        waiting += [
            (int(graph.twins[own]), int(graph.twins[partner[own]]))
            for own in graph.around(dart)
            if between[graph.tails[graph.twins[own]]]
        ]
    found = []
    for dart, within in boundary.tolist():
        if dart == within:
            found.append(dart)
            continue
        back = partner.get(int(graph.twins[dart]), -1)
        farther = int(graph.twins[back])
        if back < 0 or not _are_alike(graph, int(graph.tails[dart]), int(graph.tails[farther])):
            return None
        found.append(farther)
    taken = inside.copy()
    taken[list(image.values())] = True
    farthest = np.array(found, dtype=np.int64)
    is_whole = not taken[graph.tails[farthest]].any() and (piece_of(graph, farthest) == taken).all()
    return farthest if is_whole else None


def _are_alike(graph: OrderedGraph, node: int, other: int) -> bool:
    """Whether two nodes have one type and as many docking sites."""
    sizes = graph.starts[[node + 1, other + 1]] - graph.starts[[node, other]]
    return bool(graph.types[node] == graph.types[other] and sizes[0] == sizes[1])
