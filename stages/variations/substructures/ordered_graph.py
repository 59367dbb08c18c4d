"""Ordered shape graphs: shape graphs whose parts have their docking sites in a cyclic order (substructures §4.3.2).

An edge of a graph is a node of its dual. It is seen here as two *darts*, one from each of its ends, so that a pair of
darts says which ends of two dual nodes are laid upon each other.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np


class OrderedGraph(NamedTuple):
    """A simple graph with typed nodes and a cyclic order of the darts of each.

    types int64 (n,); starts int64 (n + 1,): the darts of node v are `starts[v]` to `starts[v + 1]`, in their order;
    tails int64 (2 m,): the node of each dart; twins int64 (2 m,): the other dart of its edge; labels int64 (2 m,): the
    docking of the edge as seen from the dart's node, or 0.
    """

    types: np.ndarray
    starts: np.ndarray
    tails: np.ndarray
    twins: np.ndarray
    labels: np.ndarray

    def neighbours(self, node: int) -> list[int]:
        """The nodes around `node`, in their order."""
        around: list[int] = self.tails[self.twins[self.starts[node] : self.starts[node + 1]]].tolist()
        return around

    def around(self, dart: int) -> list[int]:
        """The darts of a node in their order, from one on."""
        start, end = int(self.starts[self.tails[dart]]), int(self.starts[self.tails[dart] + 1])
        return [*range(dart, end), *range(start, dart)]

    def edges(self) -> np.ndarray:
        """The edges as pairs of nodes i < j in lexicographic order, int32 (m, 2)."""
        heads = self.tails[self.twins]
        pairs = np.stack([self.tails, heads], axis=1)[self.tails < heads]
        edges: np.ndarray = pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))].astype(np.int32)
        return edges

    def docking_labels(self) -> np.ndarray:
        """The dockings of `edges`, as seen from either end, counted from 0, int32 (m, 2)."""
        heads = self.tails[self.twins]
        forth = np.flatnonzero(self.tails < heads)
        forth = forth[np.lexsort((heads[forth], self.tails[forth]))]
        labels: np.ndarray = np.stack([self.labels[forth], self.labels[self.twins[forth]]], axis=1).astype(np.int32) - 1
        return labels


def ordered_graph(
    types: Sequence[int] | np.ndarray,
    orders: Sequence[Sequence[int]],
    labels: Sequence[Sequence[int]] | None = None,
) -> OrderedGraph:
    """The graph of nodes of `types` whose neighbours are `orders`, in cyclic order, with their dockings.

    Raises ValueError where a node has itself or one node twice around it, or not the node that has it.
    """
    degrees = [len(each) for each in orders]
    starts = np.concatenate([[0], np.cumsum(degrees)]).astype(np.int64)
    dart_of: dict[tuple[int, int], int] = {}
    for node, around in enumerate(orders):
        for place, other in enumerate(around):
            if other == node or (node, other) in dart_of:
                raise ValueError(f"node {node} has node {other} around it, which is itself or stands there twice")
            dart_of[node, other] = int(starts[node]) + place
    lone = next((pair for pair in dart_of if pair[::-1] not in dart_of), None)
    if lone is not None:
        raise ValueError(f"node {lone[0]} has node {lone[1]} around it, but not the other way round")
    return OrderedGraph(
        types=np.asarray(types, dtype=np.int64),
        starts=starts,
        tails=np.repeat(np.arange(len(orders)), degrees),
        twins=np.array([dart_of[pair[::-1]] for pair in dart_of], dtype=np.int64),
        labels=np.array([each for row in labels or () for each in row] or [0] * len(dart_of), dtype=np.int64),
    )
