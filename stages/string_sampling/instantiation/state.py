"""The data of the solver: the graph, the method, and the state of the search.

A value is a placement of a node: an oriented part type with a pose. The values of a node are its domain, which exists
once a neighbour is placed. Values are appended and removed like a stack, along the trail of `solver`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stages.shape.arrays import IntArray

N_VALUES, N_PLACED, TRAIL_LENGTH, N_PLACEMENTS, N_CONFLICTS = range(5)
"""Indices of `SolverState.counts`."""


class SolverMethod(NamedTuple):
    """Steps of the solver; those that can be turned off are for comparison."""

    checked: bool = True  # parts are checked when placed; else once all are
    constrained: bool = (
        True  # the node with the fewest values is next, and all open domains are pruned; else a random one
    )
    backtracks: bool = True  # conflicts are undone; else the search restarts
    closes: bool = True  # values from which a cycle cannot close are pruned
    whole: bool = True  # the graph has all contacts
    ended: bool = True  # a part must have a complete neighbourhood, if the graph has only some contacts
    budget: int = 4000  # placements at most


STANDARD_METHOD = SolverMethod()


class GraphTables(NamedTuple):
    """A graph of n nodes and m edges."""

    labels: np.ndarray  # int64 (n,)
    starts: np.ndarray  # int64 (n + 1,): neighbours of node i are ends[starts[i] : starts[i + 1]]
    ends: np.ndarray  # int64 (2 m,)
    rows: np.ndarray  # int32 (n, n): the edge of two nodes, or -1
    core: np.ndarray  # bool (n,): nodes on cycles, or between them


class SolverState(NamedTuple):
    """The state of a search over n nodes, with room for v values."""

    types: np.ndarray  # int64 (v,): part type of each value
    orientations: np.ndarray  # int64 (v,)
    rotations: np.ndarray  # float64 (v, 3, 3)
    translations: np.ndarray  # float64 (v, 3)
    boxes: np.ndarray  # float64 (v, 2, 3): centre and half extents
    nodes: np.ndarray  # int64 (v,)
    scores: np.ndarray  # float64 (v,): the value with the highest score is tried first
    in_domain: np.ndarray  # bool (v,): not pruned
    domain_start: np.ndarray  # int64 (n,): first value of the node, or -1 without a domain
    domain_end: np.ndarray  # int64 (n,)
    domain_size: np.ndarray  # int64 (n,): values in the domain
    assigned: np.ndarray  # int64 (n,): value of the placed node, or -1
    order: np.ndarray  # int64 (n,): placed nodes, in order
    weights: np.ndarray  # float64 (n,): 1 + conflicts at the node
    trail: np.ndarray  # int64 (v + 2 n,)
    decisions: np.ndarray  # int64 (n, 2): length of the trail before the decision, and its value
    neighbours: np.ndarray  # int64 (n, labels): placed neighbours by label
    touches: np.ndarray  # bool (n, n): a placed part touches one placed before
    framed: np.ndarray  # bool (n,): the node has a frame
    frame_rotations: np.ndarray  # float64 (n, 3, 3)
    frame_translations: np.ndarray  # float64 (n, 3)
    queue: np.ndarray  # int64 (n,), scratch
    before: np.ndarray  # int64 (n,), scratch
    counts: np.ndarray  # int64 (5,)


def graph_tables(labels: np.ndarray, edges: IntArray) -> GraphTables:
    """Return the tables of a graph with labels (n,) and edges (m, 2), i < j."""
    n, pairs = len(labels), np.asarray(edges, dtype=np.int64).reshape(-1, 2)
    tails, heads = np.concatenate([pairs, pairs[:, ::-1]]).T
    order = np.lexsort((heads, tails))
    rows = np.full((n, n), -1, dtype=np.int32)
    rows[pairs[:, 0], pairs[:, 1]] = rows[pairs[:, 1], pairs[:, 0]] = np.arange(len(pairs))
    return GraphTables(
        labels=np.asarray(labels, dtype=np.int64),
        starts=np.searchsorted(tails[order], np.arange(n + 1)),
        ends=heads[order],
        rows=rows,
        core=_core(rows),
    )


def _core(rows: np.ndarray) -> np.ndarray:
    """Return the nodes that remain when leaves are removed repeatedly, bool (n,)."""
    joined = rows >= 0
    core = np.ones(len(rows), dtype=np.bool_)
    while True:
        leaves = core & ((joined & core).sum(axis=1) < 2)
        if not leaves.any():
            return core
        core &= ~leaves


def new_state(nodes: int, labels: int, values: int) -> SolverState:
    """Return a state with room for some number of nodes, labels and values."""
    return SolverState(
        types=np.zeros(values, dtype=np.int64),
        orientations=np.zeros(values, dtype=np.int64),
        rotations=np.zeros((values, 3, 3)),
        translations=np.zeros((values, 3)),
        boxes=np.zeros((values, 2, 3)),
        nodes=np.zeros(values, dtype=np.int64),
        scores=np.zeros(values),
        in_domain=np.zeros(values, dtype=np.bool_),
        domain_start=np.full(nodes, -1, dtype=np.int64),
        domain_end=np.zeros(nodes, dtype=np.int64),
        domain_size=np.zeros(nodes, dtype=np.int64),
        assigned=np.full(nodes, -1, dtype=np.int64),
        order=np.zeros(nodes, dtype=np.int64),
        weights=np.ones(nodes),
        trail=np.zeros(values + 2 * nodes, dtype=np.int64),
        decisions=np.zeros((nodes, 2), dtype=np.int64),
        neighbours=np.zeros((nodes, labels), dtype=np.int64),
        touches=np.zeros((nodes, nodes), dtype=np.bool_),
        framed=np.zeros(nodes, dtype=np.bool_),
        frame_rotations=np.zeros((nodes, 3, 3)),
        frame_translations=np.zeros((nodes, 3)),
        queue=np.zeros(nodes, dtype=np.int64),
        before=np.zeros(nodes, dtype=np.int64),
        counts=np.zeros(5, dtype=np.int64),
    )
