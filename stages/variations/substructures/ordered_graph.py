"""Ordered shape graphs: shape graphs whose parts have their docking sites in a cyclic order (substructures §4.3.2).

An edge of a graph is a node of its dual. It is represented by two *darts*, one from each end, so that a pair of darts
says which ends of two dual nodes are laid on each other.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np


class OrderedGraph(NamedTuple):
    """A simple graph with typed nodes and a cyclic order of the darts of each."""

    types: np.ndarray  # int64 (n,)
    starts: np.ndarray  # int64 (n + 1,): the darts of node v are starts[v] to starts[v + 1], in order
    tails: np.ndarray  # int64 (2 m,): node of each dart
    twins: np.ndarray  # int64 (2 m,): the other dart of its edge
    labels: np.ndarray  # int64 (2 m,): docking of the edge as seen from the dart's node, or 0

    def neighbours(self, node: int) -> list[int]:
        """Return the nodes around `node`, in order."""
        around: list[int] = self.tails[self.twins[self.starts[node] : self.starts[node + 1]]].tolist()
        return around

    def around(self, dart: int) -> list[int]:
        """Return the darts of a node in order, from one of them."""
        start, end = int(self.starts[self.tails[dart]]), int(self.starts[self.tails[dart] + 1])
        return [*range(dart, end), *range(start, dart)]

    def edges(self) -> np.ndarray:
        """Return the edges as pairs of nodes i < j in lexicographic order, int32 (m, 2)."""
        heads = self.tails[self.twins]
        pairs = np.stack([self.tails, heads], axis=1)[self.tails < heads]
        edges: np.ndarray = pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))].astype(np.int32)
        return edges

    def docking_labels(self) -> np.ndarray:
        """Return the dockings of `edges`, seen from either end, counted from 0, int32 (m, 2)."""
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
    """Return the graph of nodes of `types` with neighbours `orders`, in cyclic order, and their dockings.

    Raise ValueError where a node has itself or one node twice around it, or not the node that has it.
    """
    degrees = [len(order) for order in orders]
    starts = np.concatenate([[0], np.cumsum(degrees)]).astype(np.int64)
    dart_of: dict[tuple[int, int], int] = {}
    for node, around in enumerate(orders):
        for index, other in enumerate(around):
            if other == node or (node, other) in dart_of:
                raise ValueError(f"node {node} has node {other} around it, which is itself or occurs twice")
            dart_of[node, other] = int(starts[node]) + index
    lone = next((pair for pair in dart_of if pair[::-1] not in dart_of), None)
    if lone is not None:
        raise ValueError(f"node {lone[0]} has node {lone[1]} around it, but not the other way round")
    return OrderedGraph(
        types=np.asarray(types, dtype=np.int64),
        starts=starts,
        tails=np.repeat(np.arange(len(orders)), degrees),
        twins=np.array([dart_of[pair[::-1]] for pair in dart_of], dtype=np.int64),
        labels=np.array([label for row in labels or () for label in row] or [0] * len(dart_of), dtype=np.int64),
    )
