"""Partial symmetries: two graphs laid on each other from a pair of darts, as far as they agree (substructures §4.3.1,
§4.3.2).

Compiled code sees the two as one graph: nodes and darts of the second are counted on from those of the first.

state: `Overlay`; the current symmetry is image, partner and queue
invariant: after `lift(graph, over, k)` everything but the first k matched pairs is as before they were laid on
ends: `lay_over` and `go_on` return a sum of hashes that identifies the symmetry, or 0 where nothing matches
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np

from stages.shape.geometry.hash_tables import mix
from stages.variations.substructures.ordered_graph import OrderedGraph

CONFLICTS, DEFECTS, MATCHED, ROWS, WORK = range(5)
"""Indices of `Overlay.counts`: parts met again in another place, pairs of parts that a dummy edge would match, matched
parts, rows of the boundary, and darts looked at, which is never reset."""
MAX_DEFECTS = 64
"""Defects of one partial symmetry on which dummy edges are tried."""


class Overlay(NamedTuple):
    """The current partial symmetry, for n nodes and m darts of both graphs."""

    image: np.ndarray  # int64 (n,): node of the other graph, or -1
    partner: np.ndarray  # int64 (m,): dart of the other graph, or -1
    queue: np.ndarray  # int64 (n,): matched nodes of the first graph, in the order in which they were met
    defects: np.ndarray  # int64 (d, 2)
    counts: np.ndarray  # int64 (5,): see CONFLICTS
    rows: np.ndarray  # int64 (m, 2): the boundary, for `find_regions`
    row_of: np.ndarray  # int64 (m,): row of a dart, or -1
    lines: np.ndarray  # int64 (m, 4): of each row see `regions.LEADER`
    marks: np.ndarray  # int64 (n, 3): of each node see `regions.FROM`


def side_by_side(a: OrderedGraph, b: OrderedGraph) -> OrderedGraph:
    """Return two graphs as one; nodes and darts of the second are counted on from those of the first."""
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
    """Return room for the partial symmetries of two graphs with `nodes` nodes and `darts` darts."""
    return Overlay(
        np.full(nodes, -1, dtype=np.int64),
        np.full(darts, -1, dtype=np.int64),
        np.empty(nodes, dtype=np.int64),
        np.empty((MAX_DEFECTS, 2), dtype=np.int64),
        np.zeros(5, dtype=np.int64),
        np.empty((darts, 2), dtype=np.int64),
        np.full(darts, -1, dtype=np.int64),
        np.empty((darts, 4), dtype=np.int64),
        np.full((nodes, 3), -1, dtype=np.int64),
    )


@numba.njit(cache=True)
def pair_hash(x, y):
    """Return a hash of a pair of darts, or of one and -1."""
    return mix(np.uint64(x + 1) * np.uint64(0x9E3779B97F4A7C15) + np.uint64(y + 2))


@numba.njit(cache=True)
def agree(graph, d, e, by_docking):
    """Return whether the edges of two darts are of one kind, as far as dockings tell."""
    labels, twins = graph.labels, graph.twins
    return not by_docking or (labels[d] == labels[e] and labels[twins[d]] == labels[twins[e]])


@numba.njit(cache=True)
def _match(graph, d, e, side, place, over):
    """Lay the tail of dart e on that of d, dart on dart in order; return whether that was possible.

    side: 0 or 1 if the first or second has one more dart: the one at `place` is passed over; otherwise -1
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
        if abs(first - second) == 1 and over.counts[DEFECTS] < MAX_DEFECTS:
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
def lay_over(graph, d, e, by_docking, passed, over):
    """Lay dart e of the second graph on dart d of the first, and all that follows; return the hash of the symmetry, or
    0.

    It goes on over each of `passed` int64 (q, 4) in turn, as `go_on` takes them. `over` is as `lift` leaves it. The
    order is breadth first, so that where a way round leads elsewhere the nearer match stays.
    """
    over.counts[CONFLICTS] = over.counts[DEFECTS] = over.counts[MATCHED] = 0
    total = _extend(graph, d, e, np.int64(-1), np.int64(0), by_docking, over)
    for k in range(len(passed)):
        more = go_on(graph, passed[k], by_docking, over)
        if more == 0:
            return np.uint64(0)
        total += more
    return total


@numba.njit(cache=True)
def go_on(graph, dummy, by_docking, over):
    """Continue the current symmetry over one dummy edge of the dual (§4.4); return by how much its hash grows, or 0.

    dummy: int64 (4,), either (d, e, 0 or 1, place), where the first or the second graph has one more docking site, or
        (x, y, -1, 0), darts beyond an unmatched region, from which the symmetry goes on
    """
    more = _extend(graph, dummy[0], dummy[1], dummy[2], dummy[3], by_docking, over)
    return more + pair_hash(dummy[0], dummy[3]) if more != 0 and dummy[2] >= 0 else more


@numba.njit(cache=True)
def _extend(graph, d, e, side, place, by_docking, over):
    """Match the tails of two darts and all that they lead to; return a sum of hashes of the pairs, 0 if none match."""
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
                _match(graph, back, ahead, np.int64(-1), np.int64(0), over)
    return total


@numba.njit(cache=True)
def lift(graph, over, left):
    """Remove all matched pairs of parts but the first `left`."""
    for k in range(left, over.counts[MATCHED]):
        v = over.queue[k]
        for node in (v, over.image[v]):
            over.image[node] = -1
            for x in range(graph.starts[node], graph.starts[node + 1]):
                over.partner[x] = -1
    over.counts[MATCHED] = left
