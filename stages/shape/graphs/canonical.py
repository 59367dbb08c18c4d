"""Canonical graphs: one order of the nodes, and one digest, for all drawings of the same coloured graph.

Colour refinement tells most nodes of a shape graph apart. BLISS orders the remaining ones, on the subgraph where they
differ by more than names. So both answers are exact, and the second step usually has little to do.
"""

from __future__ import annotations

import hashlib

import numpy as np
import numpy.typing as npt

from stages.shape.arrays import IntArray, TypeArray

Indices = npt.NDArray[np.int64]


def graph_digest(types: TypeArray, edges: IntArray) -> str:
    """Return the hex sha256 of a graph with coloured nodes: equal exactly for isomorphic graphs.

    types: int16 (n,)
    edges: each edge once, in either direction, int32 (m, 2)

    Raises ValueError as `canonical_order` does.
    """
    return _digest(types, edges, None)


def docking_digest(types: TypeArray, edges: IntArray, labels: IntArray) -> str:
    """Return the hex sha256 of a graph with a label at each end of its edges: equal exactly for isomorphic ones.

    labels: label seen from `edges[:, 0]` and that from `edges[:, 1]` (docking configurations), int32 (m, 2)
    """
    return _digest(types, edges, labels)


def canonical_order(types: TypeArray, edges: IntArray, edge_labels: IntArray | None = None) -> Indices:
    """Return the nodes in canonical order, int64 (n,): isomorphic graphs in this order are equal.

    types: colours of the nodes, int16 (n,); nodes of lower type come first
    edges: each edge once, int32 (m, 2)
    edge_labels: labels of each edge as seen from its two ends, int32 (m, 2)

    Raises ValueError for an edge to a node that does not exist, from a node to itself, or given twice.
    """
    from stages.shape.graphs.refinement import refine

    colors = np.ascontiguousarray(types, dtype=np.int64)
    pairs = np.ascontiguousarray(edges, dtype=np.int64).reshape(-1, 2)
    _check_simple(len(colors), pairs)
    forward, backward, classes = _arc_classes(len(pairs), edge_labels)
    order, start = refine(colors, pairs, forward, backward, classes)
    if (start == np.arange(len(order))).all():
        return np.asarray(order)
    return _settle(order, start, pairs, forward, backward)


def _digest(types: TypeArray, edges: IntArray, labels: IntArray | None) -> str:
    order = canonical_order(types, edges, labels)
    rank = np.empty(len(order), dtype=np.int64)
    rank[order] = np.arange(len(order))
    ends = rank[np.asarray(edges).reshape(-1, 2)]
    turned = ends[:, 0] > ends[:, 1]
    ends.sort(axis=1)
    rows = np.argsort(ends[:, 0] * len(order) + ends[:, 1])
    content = hashlib.sha256(np.array([len(order), len(ends)], dtype="<i8").tobytes())
    content.update(np.asarray(types)[order].astype("<i8").tobytes())
    content.update(ends[rows].astype("<i8").tobytes())
    if labels is not None:
        seen = np.asarray(labels).reshape(-1, 2)
        content.update(np.where(turned[:, None], seen[:, ::-1], seen)[rows].astype("<i8").tobytes())
    return content.hexdigest()


def _check_simple(n: int, pairs: Indices) -> None:
    if not len(pairs):
        return
    if pairs.min() < 0 or pairs.max() >= n:
        raise ValueError(
            f"an edge names a node that is not there: {n} nodes, edges name {pairs.min()} to {pairs.max()}"
        )
    low, high = np.minimum(pairs[:, 0], pairs[:, 1]), np.maximum(pairs[:, 0], pairs[:, 1])
    keys = np.sort(low * n + high)
    if (low == high).any() or (keys[1:] == keys[:-1]).any():
        raise ValueError("the graph is not simple: an edge stands twice, or leads from a node to itself")


def _arc_classes(m: int, labels: IntArray | None) -> tuple[Indices, Indices, int]:
    """Return the class of the arc along each edge, the class of the arc against it, and the number of classes."""
    if labels is None:
        none = np.zeros(m, dtype=np.int64)
        return none, none, 1
    seen = np.asarray(labels, dtype=np.int64).reshape(-1, 2)
    if len(seen) != m:
        raise ValueError(f"{len(seen)} rows of labels for {m} edges")
    values, ranks = np.unique(seen, return_inverse=True)
    near, far = ranks.reshape(-1, 2).T
    kinds, numbers = np.unique(
        np.concatenate([near, far]) * len(values) + np.concatenate([far, near]), return_inverse=True
    )
    return numbers[:m], numbers[m:], max(len(kinds), 1)


def _settle(order: Indices, start: Indices, pairs: Indices, forward: Indices, backward: Indices) -> Indices:
    """Return `order` with the nodes inside each cell in canonical order too.

    If a cell is connected to another cell completely, or not, that relation does not tell nodes apart. So
    BLISS sees only the other relations, and only their nodes.
    """
    n = len(order)
    cell = np.empty(n, dtype=np.int64)
    cell[order] = start
    size = np.bincount(start, minlength=n)
    open_pairs = (size[cell[pairs[:, 0]]] > 1) & (size[cell[pairs[:, 1]]] > 1)
    kept = pairs[open_pairs]
    if not len(kept):
        return order
    along, against = forward[open_pairs], backward[open_pairs]
    swap = cell[kept[:, 0]] > cell[kept[:, 1]]
    ends = np.where(swap[:, None], kept[:, ::-1], kept)
    low_to_high, high_to_low = np.where(swap, against, along), np.where(swap, along, against)
    a, b = cell[ends[:, 0]], cell[ends[:, 1]]
    _, relation, edges_of = np.unique(a * n + b, return_inverse=True, return_counts=True)
    relation = relation.reshape(-1)
    possible = np.where(a == b, size[a] * (size[a] - 1) // 2, size[a] * size[b])
    same_kind = np.ones(len(edges_of), dtype=np.bool_)
    sample = np.zeros(len(edges_of), dtype=np.int64)
    sample[relation] = low_to_high
    differs = (low_to_high != sample[relation]) | ((a == b) & (high_to_low != low_to_high))
    same_kind[relation[differs]] = False
    informative = ~(same_kind[relation] & (edges_of[relation] == possible))
    if not informative.any():
        return order
    plain = same_kind[relation[informative]]
    return _bliss(order, start, ends[informative], plain, low_to_high[informative], high_to_low[informative])


def _bliss(
    order: Indices, start: Indices, edges: Indices, plain: npt.NDArray[np.bool_], along: Indices, against: Indices
) -> Indices:
    """Return `order` with the nodes of `edges` in the canonical order of igraph's BLISS inside their cells.

    Edges that are not `plain` carry classes, `along` and `against`. They get coloured nodes of their own: one if both
    classes are equal, else two in a row.
    """
    import igraph

    active = np.zeros(len(order), dtype=np.bool_)
    active[edges] = True
    positions = np.flatnonzero(active[order])
    nodes = order[positions]
    number = np.empty(len(order), dtype=np.int64)
    number[nodes] = np.arange(len(nodes))
    cells = start[positions]
    ends = number[edges]
    same, turning = ~plain & (along == against), ~plain & (along != against)
    near = len(nodes) + np.cumsum(~plain) - 1
    far = len(nodes) + np.count_nonzero(~plain) + np.cumsum(turning) - 1
    arcs = np.concatenate(
        [
            ends[plain],
            np.stack([ends[~plain, 0], near[~plain]], axis=1),
            np.stack([near[same], ends[same, 1]], axis=1),
            np.stack([near[turning], far[turning]], axis=1),
            np.stack([far[turning], ends[turning, 1]], axis=1),
        ]
    )
    colors = np.concatenate([cells, len(order) + along[~plain], len(order) + against[turning]])
    graph = igraph.Graph(n=len(colors), edges=arcs)
    # igraph 1.0 answers with the nodes in canonical order, whatever its documentation says of new numbers.
    rank = np.argsort(graph.canonical_permutation(color=colors.tolist()))[: len(nodes)]
    settled = order.copy()
    settled[positions] = nodes[np.lexsort((rank, cells))]
    return settled
