"""What the solver works on: the graph to be put together, how it is to go about it, and the shape in hand.

A *value* is a place for a part: a stance with a pose. The values of a node, once one of its neighbours stands, are its
domain. Values are made and taken back like a stack, and so is everything else, along a trail.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stages.shape.arrays import IntArray

VALUES, PLACED, TRAIL, TRIES, FAILS = range(5)
"""Places in `Solving.counts`: numbers of values, parts that stand, entries of the trail, parts that were put somewhere,
and dead ends."""


class SolverMethod(NamedTuple):
    """How to go about it. checked: parts are checked as they are put down; constrained: the node with fewest values is
    next, and the values of all that may be next are held against every part that stands; else a random one;
    backtracks: dead ends are taken back, step by step; else the shape is begun anew; closes: values from which a cycle
    cannot be closed any more are not tried; whole: the graph tells of all contacts; ended: every part has all that the
    grammar asks for beside it, or else, where the graph is not whole, may still get it; budget: parts put down at most.
    """

    checked: bool = True
    constrained: bool = True
    backtracks: bool = True
    closes: bool = True
    whole: bool = True
    ended: bool = True
    budget: int = 4000


STANDARD_METHOD = SolverMethod()


class GraphTables(NamedTuple):
    """labels int64 (n,); starts int64 (n + 1,), ends int64 (2 m,): neighbours of each node; rows int32 (n, n): the edge
    between two nodes, or -1; core bool (n,): nodes on cycles or between them.
    """

    labels: np.ndarray
    starts: np.ndarray
    ends: np.ndarray
    rows: np.ndarray
    core: np.ndarray


class SolverState(NamedTuple):
    """The shape in hand."""

    types: np.ndarray  # int64 (v,) of the values
    stances: np.ndarray  # int64 (v,)
    rotations: np.ndarray  # float64 (v, 3, 3)
    translations: np.ndarray  # float64 (v, 3)
    boxes: np.ndarray  # float64 (v, 2, 3): centre and half extents
    nodes: np.ndarray  # int64 (v,)
    scores: np.ndarray  # float64 (v,)
    alive: np.ndarray  # bool (v,)
    first: np.ndarray  # int64 (n,): first value of each node's domain, or -1
    last: np.ndarray  # int64 (n,): end of the domain
    left: np.ndarray  # int64 (n,): living values
    at: np.ndarray  # int64 (n,): the value where the node stands, or -1
    order: np.ndarray  # int64 (n,): nodes that stand, in order
    weights: np.ndarray  # float64 (n,): how often it went wrong there
    trail: np.ndarray  # int64 (t,): values struck; -1 - n for nodes put down; -1 - most - n for domains made
    decisions: np.ndarray  # int64 (d, 2): length of the trail before, and the value chosen
    near: np.ndarray  # int64 (n, labels): of the parts that stand, neighbours by label
    touch: np.ndarray  # bool (n, n): a part that stands touches one that stood before
    framed: np.ndarray  # bool (n,): it has a frame
    frame_rotations: np.ndarray  # float64 (n, 3, 3)
    frame_translations: np.ndarray  # float64 (n, 3)
    queue: np.ndarray  # int64 (n,) scratch
    before: np.ndarray  # int64 (n,) scratch
    counts: np.ndarray  # int64 (5,)


def graph_tables(labels: np.ndarray, edges: IntArray) -> GraphTables:
    """A graph of labels (n,) and edges (m, 2), i < j, for the solver."""
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
    """The nodes that are left when leaves are taken away again and again, bool (n,)."""
    joined = rows >= 0
    core = np.ones(len(rows), dtype=np.bool_)
    while True:
        leaves = core & ((joined & core).sum(axis=1) < 2)
        if not leaves.any():
            return core
        core &= ~leaves


def new_state(nodes: int, labels: int, values: int) -> SolverState:
    """Room for graphs of so many nodes of a kit with so many labels, and for so many values."""
    return SolverState(
        types=np.zeros(values, dtype=np.int64),
        stances=np.zeros(values, dtype=np.int64),
        rotations=np.zeros((values, 3, 3)),
        translations=np.zeros((values, 3)),
        boxes=np.zeros((values, 2, 3)),
        nodes=np.zeros(values, dtype=np.int64),
        scores=np.zeros(values),
        alive=np.zeros(values, dtype=np.bool_),
        first=np.full(nodes, -1, dtype=np.int64),
        last=np.zeros(nodes, dtype=np.int64),
        left=np.zeros(nodes, dtype=np.int64),
        at=np.full(nodes, -1, dtype=np.int64),
        order=np.zeros(nodes, dtype=np.int64),
        weights=np.ones(nodes),
        trail=np.zeros(values + 2 * nodes, dtype=np.int64),
        decisions=np.zeros((nodes, 2), dtype=np.int64),
        near=np.zeros((nodes, labels), dtype=np.int64),
        touch=np.zeros((nodes, nodes), dtype=np.bool_),
        framed=np.zeros(nodes, dtype=np.bool_),
        frame_rotations=np.zeros((nodes, 3, 3)),
        frame_translations=np.zeros((nodes, 3)),
        queue=np.zeros(nodes, dtype=np.int64),
        before=np.zeros(nodes, dtype=np.int64),
        counts=np.zeros(5, dtype=np.int64),
    )
