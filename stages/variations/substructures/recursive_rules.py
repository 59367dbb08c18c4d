"""Recursive rules: where one of two pieces is part of the other, an operation can be applied to its own result
(substructures §4.2). It grows the shape or, the other way round, shrinks it.
"""

from __future__ import annotations

import numpy as np

from stages.variations.substructures.ordered_graph import OrderedGraph
from stages.variations.substructures.replacement import Replacement, piece_of


def growth_of(graph: OrderedGraph, boundary: np.ndarray) -> int:
    """Return by how many parts a recursive rule grows a shape each time, negative where it shrinks it, 0 for other
    operations.

    boundary: int64 (b, 2), darts of one graph, as in `Operations`
    """
    taken, piece = piece_of(graph, boundary[:, 0]), piece_of(graph, boundary[:, 1])
    smaller, larger = (taken, piece) if taken.sum() < piece.sum() else (piece, taken)
    if (boundary < 0).any() or not smaller.any() or (smaller & ~larger).any():
        return 0
    return int(piece.sum()) - int(taken.sum())


def cut_again(made: Replacement, graph: OrderedGraph, boundary: np.ndarray) -> np.ndarray | None:
    """Return the boundary along which a growing rule can be applied to its own result, int64 (b, 2), or None.

    It surrounds the piece that the rule takes out, in the copy of the piece that it put in; that must be whole there.
    boundary: that of the rule between two pieces of `graph`, however often it was applied before
    made: what it made last
    """
    inner = graph.twins[boundary[:, 0]].tolist()
    if any(dart not in made.darts_of_giver for dart in inner):
        return None
    outer = made.graph.twins[[made.darts_of_giver[dart] for dart in inner]]
    return np.stack([outer, boundary[:, 1]], axis=1)


def cut_farther(graph: OrderedGraph, boundary: np.ndarray, cut: np.ndarray) -> np.ndarray | None:
    """Return the cut, int64 (b,), inside which a shrinking rule finds what it takes out another time, or None.

    So several applications become one. The parts between the two pieces, seen from the inner one, are laid on what is
    outside `cut`.
    boundary: int64 (b, 2), that of the rule between two pieces of `graph`
    cut: its first column at first, later what this function returned before
    """
    outer, inner = piece_of(graph, boundary[:, 0]), piece_of(graph, boundary[:, 1])
    between, inside = outer & ~inner, piece_of(graph, cut)
    partner: dict[int, int] = {}
    image: dict[int, int] = {}
    waiting = list(zip(boundary[:, 1].tolist(), cut.tolist(), strict=True))
    while waiting:
        dart, other = waiting.pop()
        node, target = int(graph.tails[dart]), int(graph.tails[other])
        if not between[node] or partner.get(dart, -1) == other:
            continue
        if node in image or target in image.values() or inside[target] or not _are_alike(graph, node, target):
            return None
        image[node] = target
        partner.update(zip(graph.around(dart), graph.around(other), strict=True))
        waiting += [
            (int(graph.twins[own]), int(graph.twins[partner[own]]))
            for own in graph.around(dart)
            if between[graph.tails[graph.twins[own]]]
        ]
    next_cut = []
    for dart, within in boundary.tolist():
        if dart == within:
            next_cut.append(dart)
            continue
        back = partner.get(int(graph.twins[dart]), -1)
        farther = int(graph.twins[back])
        if back < 0 or not _are_alike(graph, int(graph.tails[dart]), int(graph.tails[farther])):
            return None
        next_cut.append(farther)
    taken = inside.copy()
    taken[list(image.values())] = True
    farthest = np.array(next_cut, dtype=np.int64)
    is_whole = not taken[graph.tails[farthest]].any() and (piece_of(graph, farthest) == taken).all()
    return farthest if is_whole else None


def _are_alike(graph: OrderedGraph, node: int, other: int) -> bool:
    """Return whether two nodes have one type and equal numbers of docking sites."""
    sizes = graph.starts[[node + 1, other + 1]] - graph.starts[[node, other]]
    return bool(graph.types[node] == graph.types[other] and sizes[0] == sizes[1])
