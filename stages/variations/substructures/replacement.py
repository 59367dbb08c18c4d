"""Graph operations: a piece is taken out and a copy of another is set into the hole (substructures §4.2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stages.variations.substructures.ordered_graph import OrderedGraph, ordered_graph
from stages.variations.substructures.regions import cut_off


@dataclass(frozen=True)
class Replacement:
    """The result of an operation."""

    graph: OrderedGraph
    from_base: np.ndarray  # int64 (a.n,), node of the result for each node of the base, or -1
    from_giver: np.ndarray  # int64 (b.n,), the same for the giver
    darts_of_giver: dict[int, int]  # dart of the result for each dart of the giver that was copied


def piece_of(graph: OrderedGraph, cut: np.ndarray) -> np.ndarray:
    """Return the nodes that the darts `cut` int64 (b,) cut off, bool (n,); darts of -1 do not count.

    These are what the darts point to and all that is connected with it without crossing the cut.
    """
    inside: np.ndarray = cut_off(graph, np.ascontiguousarray(cut))
    return inside


def replace_piece(base: OrderedGraph, giver: OrderedGraph, boundary: np.ndarray) -> Replacement | None:
    """Put the giver's piece in place of the base's; return None where two parts would touch twice, or one itself.

    boundary: int64 (b, 2), as in `Operations`; what stays of the base meets the giver's piece as what stayed of the
        giver met it. Where a piece is empty the parts at both sides of its boundary meet.
    """
    taken, piece = piece_of(base, boundary[:, 0]), piece_of(giver, boundary[:, 1])
    from_base, from_giver = np.full(len(taken), -1), np.full(len(piece), -1)
    stays = int((~taken).sum())
    from_base[~taken] = np.arange(stays)
    from_giver[piece] = stays + np.arange(int(piece.sum()))
    outer = {d: e for d, e in boundary.tolist() if d >= 0 and e >= 0}
    sources = {e: d for d, e in outer.items()}
    walls = set(boundary[:, 0].tolist())

    def beyond(e: int) -> int:
        """Return the node of the result that the giver's dart e leads to, or -1."""
        ahead = int(giver.twins[e])
        if from_giver[giver.tails[ahead]] >= 0:
            return int(from_giver[giver.tails[ahead]])
        return int(from_base[base.tails[sources[ahead]]]) if ahead in sources else -1

    orders: list[list[int]] = []
    labels: list[list[int]] = []
    copied: list[int] = []
    for node in np.flatnonzero(~taken).tolist():
        ends, kinds = [], []
        for dart in range(base.starts[node], base.starts[node + 1]):
            back = int(base.twins[dart])
            if dart in outer:
                end, kind = beyond(outer[dart]), int(giver.labels[outer[dart]])
            elif dart in walls or back in walls:
                continue
            else:
                end, kind = int(from_base[base.tails[back]]), int(base.labels[dart])
            if end >= 0:
                ends.append(end)
                kinds.append(kind)
        orders.append(ends)
        labels.append(kinds)
    for node in np.flatnonzero(piece).tolist():
        ends, kinds = [], []
        for dart in range(giver.starts[node], giver.starts[node + 1]):
            end = beyond(dart)
            if end >= 0:
                ends.append(end)
                kinds.append(int(giver.labels[dart]))
                copied.append(dart)
        orders.append(ends)
        labels.append(kinds)
    types = np.concatenate([base.types[~taken], giver.types[piece]])
    if any(len(set(order)) < len(order) or node in order for node, order in enumerate(orders)) or len(types) == 0:
        return None
    graph = ordered_graph(types, orders, labels)
    darts = dict(zip(copied, range(int(graph.starts[stays]), len(graph.tails)), strict=True))
    return Replacement(graph, from_base, from_giver, darts)
