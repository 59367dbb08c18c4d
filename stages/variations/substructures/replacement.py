"""Carrying out a graph operation: a piece is taken out and a copy of another is set into the hole (substructures
§4.2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stages.variations.substructures.ordered_graph import OrderedGraph, ordered_graph
from stages.variations.substructures.regions import cut_off


@dataclass(frozen=True)
class Replacement:
    """What an operation makes.

    graph: the result; from_base int64 (a.n,), from_giver int64 (b.n,): the places of their nodes in it, or -1;
    darts_of_giver: the place in the result of each dart of the giver that was copied.
    """

    graph: OrderedGraph
    from_base: np.ndarray
    from_giver: np.ndarray
    darts_of_giver: dict[int, int]


def piece_of(graph: OrderedGraph, cut: np.ndarray) -> np.ndarray:
    """The nodes that the darts `cut` int64 (b,) cut off, bool (n,): what they point to, and all that hangs together
    with it without crossing the cut. Darts of -1 are none."""
    inside: np.ndarray = cut_off(graph, np.ascontiguousarray(cut))
    return inside


def replace_piece(base: OrderedGraph, giver: OrderedGraph, boundary: np.ndarray) -> Replacement | None:
    """Put the giver's piece in the place of the base's; None where two parts would touch twice, or one itself.

    boundary: int64 (b, 2), as `Operations` says it; what stays of the base meets the piece of the giver as what stayed
    of the giver met it. Where a piece is empty the parts at both sides of its boundary meet.
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
        """The place of the node that the giver's dart e leads to, or -1."""
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
    if any(len(set(each)) < len(each) or node in each for node, each in enumerate(orders)) or len(types) == 0:
        return None
    graph = ordered_graph(types, orders, labels)
    darts = dict(zip(copied, range(int(graph.starts[stays]), len(graph.tails)), strict=True))
    return Replacement(graph, from_base, from_giver, darts)
