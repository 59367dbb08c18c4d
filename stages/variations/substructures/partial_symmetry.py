"""Partial symmetries: two graphs laid upon each other from a pair of darts on, as far as they agree (substructures
§4.3.1, §4.3.2).

Kernels see the two as one graph: the nodes and darts of the second are counted on from those of the first.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np

from stages.shape.geometry.contact_lookup import mix
from stages.variations.substructures.ordered_graph import OrderedGraph

CONFLICTS, DEFECTS, MATCHED, ROWS, WORK = range(5)
"""Places in `counts`: parts that were met again in another place; pairs of parts that a dummy edge would match; matched
parts; rows of the boundary; darts looked at, which nobody sets back."""
MOST_DEFECTS = 64
"""Defects of one partial symmetry that dummy edges are tried on."""


class Overlay(NamedTuple):
    """What one partial symmetry is laid out in; all but `counts` is as it was after `lift`, so that none costs more
    than it is large. Of n nodes and m darts of both graphs:

    image int64 (n,) and partner (m,): the node or dart of the other graph, or -1; queue (n,): the matched nodes of the
    first in the order in which they were met; defects (d, 2); counts (5,). For `find_regions`: rows (m, 2), the
    boundary; row_of (m,), the row of a dart, or -1; lines (m, 4), of each row the first row of its region, the first
    and the last node that wait in it, and a row where some do; marks (n, 3), of each node the row that it was reached
    from, or -1, and the node that waits after it, and the nodes that were reached.
    """

    image: np.ndarray
    partner: np.ndarray
    queue: np.ndarray
    defects: np.ndarray
    counts: np.ndarray
    rows: np.ndarray
    row_of: np.ndarray
    lines: np.ndarray
    marks: np.ndarray


def side_by_side(a: OrderedGraph, b: OrderedGraph) -> OrderedGraph:
    """Two graphs as one, the nodes and darts of the second counted on from those of the first."""
    nodes, darts = len(a.types), len(a.tails)
    return OrderedGraph(
        np.concatenate([a.types, b.types]),
        np.concatenate([a.starts, b.starts[1:] + darts]),
        np.concatenate([a.tails, b.tails + nodes]),
        np.concatenate([a.twins, b.twins + darts]),
        np.concatenate([a.labels, b.labels]),
    )


@numba.njit(cache=True)
def overlay(nodes, darts):
    """Room for the partial symmetries of two graphs of so many nodes and darts, none laid out."""
    return Overlay(
        np.full(nodes, -1, dtype=np.int64),
        np.full(darts, -1, dtype=np.int64),
        np.empty(nodes, dtype=np.int64),
        np.empty((MOST_DEFECTS, 2), dtype=np.int64),
        np.zeros(5, dtype=np.int64),
        np.empty((darts, 2), dtype=np.int64),
        np.full(darts, -1, dtype=np.int64),
        np.empty((darts, 4), dtype=np.int64),
        np.full((nodes, 3), -1, dtype=np.int64),
    )


@numba.njit(cache=True)
def pair_hash(x, y):
    """A hash of a pair of darts, or of one and -1."""
    return mix(np.uint64(x + 1) * np.uint64(0x9E3779B97F4A7C15) + np.uint64(y + 2))


@numba.njit(cache=True)
def agree(graph, d, e, by_docking):
    """Whether the edges of two darts are of one kind, as far as dockings tell."""
    labels, twins = graph.labels, graph.twins
    return not by_docking or (labels[d] == labels[e] and labels[twins[d]] == labels[twins[e]])


@numba.njit(cache=True)
def _match(graph, d, e, side, place, over):
    """Lay the tail of dart e upon that of d, dart upon dart in their order; whether that could be done.

    Of `side` 0 of the first, of 1 of the second, which has one dart more, the one at `place` from there is passed over.
    """
    v, w = graph.tails[d], graph.tails[e]
    if graph.types[v] != graph.types[w]:
        return False
    if over.image[v] >= 0 or over.image[w] >= 0:
        over.counts[CONFLICTS] += 1
        return False
    start, end, start_there, end_there = graph.starts[v], graph.starts[v + 1], graph.starts[w], graph.starts[w + 1]
    first, second = end - start, end_there - start_there
    if first != second and side < 0:
        if abs(first - second) == 1 and over.counts[DEFECTS] < MOST_DEFECTS:
            over.defects[over.counts[DEFECTS], 0] = d
            over.defects[over.counts[DEFECTS], 1] = e
            over.counts[DEFECTS] += 1
        return False
    over.image[v] = w
    over.image[w] = v
    over.queue[over.counts[MATCHED]] = v
    over.counts[MATCHED] += 1
    over.counts[WORK] += first
    x, y = d, e
    for turned in range(min(first, second)):
        if turned == place and side == 0:
            x = x + 1 if x + 1 < end else start
        elif turned == place and side == 1:
            y = y + 1 if y + 1 < end_there else start_there
        over.partner[x] = y
        over.partner[y] = x
        x = x + 1 if x + 1 < end else start
        y = y + 1 if y + 1 < end_there else start_there
    return True


@numba.njit(cache=True)
def lay_over(graph, d, e, by_docking, dummies, over):
    """The greatest partial symmetry of two graphs side by side that lays dart e of the second upon dart d of the first,
    gone on with over each of `dummies` int64 (q, 4) in turn, as `go_on` takes them; a sum of hashes that tells it, 0
    where it has no part at all, or a dummy edge leads nowhere.

    `over` is as `lift` leaves it. Breadth-first, so that where a way round leads elsewhere the nearer match stands.
    """
    over.counts[CONFLICTS] = over.counts[DEFECTS] = over.counts[MATCHED] = 0
    total = _extend(graph, d, e, -1, 0, by_docking, over)
    for k in range(len(dummies)):
        more = go_on(graph, dummies[k], by_docking, over)
        if more == 0:
            return np.uint64(0)
        total += more
    return total


@numba.njit(cache=True)
def go_on(graph, dummy, by_docking, over):
    """Go on with the symmetry in hand over one dummy edge of the dual (§4.4), which passes over what does not agree;
    what its sum of hashes grows by, or 0 where that cannot be done.

    dummy int64 (4,): either (d, e, 0 or 1, place), where the order of docking sites has one more in the first or in the
    second, or (x, y, -1, 0), darts beyond an unmatched region, from which the symmetry goes on.
    """
    more = _extend(graph, dummy[0], dummy[1], dummy[2], dummy[3], by_docking, over)
    return more + pair_hash(dummy[0], dummy[3]) if more != 0 and dummy[2] >= 0 else more


@numba.njit(cache=True)
def _extend(graph, d, e, side, place, by_docking, over):
    """Match the tails of two darts, and all that they lead to; a sum of hashes of the pairs, 0 of none."""
    begin, total = over.counts[MATCHED], np.uint64(0)
    if not _match(graph, d, e, side, place, over):
        return total
    head = begin
    while head < over.counts[MATCHED]:
        v = over.queue[head]
        head += 1
        x = graph.starts[v]
        total += pair_hash(x, over.partner[x])
        for x in range(graph.starts[v], graph.starts[v + 1]):
            y = over.partner[x]
            if y < 0 or not agree(graph, x, y, by_docking):
                continue
            back, ahead = graph.twins[x], graph.twins[y]
            if over.partner[back] != ahead:
                _match(graph, back, ahead, -1, 0, over)
    return total


@numba.njit(cache=True)
def lift(graph, over, left):
    """Take up what was laid out but the first `left` pairs of parts, so that the next symmetry can be."""
    for k in range(left, over.counts[MATCHED]):
        v = over.queue[k]
        for node in (v, over.image[v]):
            over.image[node] = -1
            for x in range(graph.starts[node], graph.starts[node + 1]):
                over.partner[x] = -1
    over.counts[MATCHED] = left
