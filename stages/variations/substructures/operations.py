"""All graph operations between two graphs, each once, in normal form (substructures §4.3, §4.4)."""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from stages.shape.geometry.hash_tables import contains, mix, with_key
from stages.variations.substructures.dummy_edges import is_alike, pass_over
from stages.variations.substructures.growing_arrays import grown
from stages.variations.substructures.ordered_graph import OrderedGraph
from stages.variations.substructures.partial_symmetry import (
    CONFLICTS,
    DEFECTS,
    MATCHED,
    ROWS,
    WORK,
    go_on,
    lay_over,
    lift,
    overlay,
    pair_hash,
    side_by_side,
)
from stages.variations.substructures.regions import find_regions, region_of

MAX_DUMMY_WORK = 5_500_000
"""Darts looked at for symmetries with dummy edges, about a third of a second. These are for sparse outliers: in dense
graphs the rest is left out, those with most dummy edges first.
"""
MAX_WAITING = 1 << 17
"""Symmetries that wait to be continued over dummy edges at most, which bounds memory."""
FOUND, LISTED, KNOWN = range(3)
"""Indices of `filled`: numbers of rows, operations, and keys of symmetries."""


@dataclass(frozen=True)
class Operations:
    """Operations that replace a piece of one graph by a piece of another, and vice versa."""

    pairs: np.ndarray
    """int64 (p, 2), darts of the first and second graph, each pointing from what stays into what is replaced; the rows
    of an operation are its boundary. A row (d, -1) or (-1, e) is a dart that a dummy edge passes over: it loses its
    end.
    """
    starts: np.ndarray  # int64 (k + 1,), the rows of each of k operations
    plain: int  # number of operations, the first ones, without dummy edges
    meetings: int
    """Lower bound of how often these are met from all pairs of darts that are alike: the tries without factoring out
    equivalent operations."""
    work: int  # number of darts looked at
    is_whole: bool
    """Whether these are all; otherwise the limit on dummy edges was met, and only the plain ones are complete."""

    def __len__(self) -> int:
        return len(self.starts) - 1

    def boundary(self, number: int) -> np.ndarray:
        """Return the boundary of one operation, int64 (b, 2)."""
        rows: np.ndarray = self.pairs[self.starts[number] : self.starts[number + 1]]
        return rows


def find_operations(a: OrderedGraph, b: OrderedGraph, violations: int = 0, by_docking: bool = False) -> Operations:
    """Return all operations between a piece of `a` and a piece of `b`, which may be the same graph.

    An operation is one unmatched region of a maximal partial symmetry, so no alike pair of parts is left out at its
    boundary. Without violations each is found from a pair of darts: O(k² n²), in practice far below k n². A symmetry
    that meets no part twice is the same from all its pairs and is found once.
    violations: dummy edges of a symmetry at most, 0 to 3 (§4.4, "robust matching"); the work is exponential in it, and
        operations with fewer come first
    by_docking: whether edges match by their dockings too, not by types alone
    """
    return Operations(*_enumerate(side_by_side(a, b), len(a.tails), a is b, by_docking, violations))


@numba.njit(cache=True)
def _enumerate(graph, darts, same, by_docking, violations):
    """List the operations between two graphs side by side; the first has `darts` darts, `same` if they are one graph.

    Returns rows and starts, the number of plain ones, meetings, work, and whether these are all.
    """
    over = overlay(len(graph.types), len(graph.tails))
    visited = np.zeros((darts, len(graph.tails) - darts), dtype=np.bool_)
    known, listed = np.zeros(1 << 10, dtype=np.uint64), np.zeros(1 << 10, dtype=np.uint64)
    pairs, starts = np.empty((256, 2), dtype=np.int64), np.zeros((256, 1), dtype=np.int64)
    filled = np.zeros(3, dtype=np.int64)
    waiting = np.empty((256, 3 + 4 * violations), dtype=np.int64)
    tail, meetings, is_whole = 0, 0, True
    nowhere = np.empty((0, 4), dtype=np.int64)
    for d in range(darts):
        for e in range(darts + d + 1 if same else darts, len(graph.tails)):
            if visited[d, e - darts] or not is_alike(graph, d, e):
                continue
            key = mix(lay_over(graph, d, e, by_docking, nowhere, over)) | np.uint64(1)
            pairs_met = _visit(graph, darts, same, over, visited) if over.counts[CONFLICTS] == 0 else 1
            if not contains(known, key):
                known = with_key(known, filled[KNOWN], key)
                filled[KNOWN] += 1
                find_regions(graph, by_docking, over)
                pairs, starts, listed, regions = _emit(darts, same, over, pairs, starts, listed, filled)
                meetings += pairs_met * regions
                if violations > 0:
                    is_whole &= tail < MAX_WAITING
                    waiting, tail = _wait(waiting, np.int64(tail), d, e, nowhere)
            lift(graph, over, 0)
    plain, limit, taken = filled[LISTED], over.counts[WORK] + MAX_DUMMY_WORK, 0
    while taken < tail and over.counts[WORK] < limit:
        depth = waiting[taken, 2]
        passed = waiting[taken, 3 : 3 + 4 * depth].copy().reshape((depth, 4))
        total = lay_over(graph, waiting[taken, 0], waiting[taken, 1], by_docking, passed, over)
        find_regions(graph, by_docking, over)
        matched, defects = over.counts[MATCHED], over.counts[DEFECTS]
        for dummy in pass_over(graph, over):
            if over.counts[WORK] >= limit:
                break
            more = go_on(graph, dummy, by_docking, over)
            if more != 0:
                key = mix(total + more) | np.uint64(1)
                if not contains(known, key):
                    known = with_key(known, filled[KNOWN], key)
                    filled[KNOWN] += 1
                    find_regions(graph, by_docking, over)
                    pairs, starts, listed, _ = _emit(darts, same, over, pairs, starts, listed, filled)
                    if depth + 1 < violations:
                        is_whole &= tail < MAX_WAITING
                        further = np.concatenate((passed.ravel(), dummy)).reshape((depth + 1, 4))
                        waiting, tail = _wait(waiting, np.int64(tail), waiting[taken, 0], waiting[taken, 1], further)
            lift(graph, over, matched)
            over.counts[DEFECTS] = defects
        lift(graph, over, 0)
        taken += over.counts[WORK] < limit
    is_whole &= taken == tail
    work = over.counts[WORK]
    return pairs[: filled[FOUND]].copy(), starts[: filled[LISTED] + 1, 0].copy(), plain, meetings, work, is_whole


@numba.njit(cache=True)
def _wait(waiting, tail, d, e, passed):
    """Append a symmetry to those that wait to be continued over dummy edges, if there is room; return these and their
    number.
    """
    if tail == MAX_WAITING:
        return waiting, tail
    waiting = grown(waiting, tail + 1)
    waiting[tail, 0], waiting[tail, 1], waiting[tail, 2] = d, e, len(passed)
    waiting[tail, 3 : 3 + 4 * len(passed)] = passed.ravel()
    return waiting, tail + 1


@numba.njit(cache=True)
def _visit(graph, darts, same, over, visited):
    """Mark all pairs of darts from which the current symmetry would be found again; return their number."""
    count = 0
    for k in range(over.counts[MATCHED]):
        for x in range(graph.starts[over.queue[k]], graph.starts[over.queue[k] + 1]):
            y = over.partner[x] - darts
            visited[x, y] = True
            count += not same or x < y
    return count


@numba.njit(cache=True)
def _emit(darts, same, over, pairs, starts, listed, filled):
    """Add the new regions of the current symmetry, by a hash of their boundaries; return the number of regions, new or
    not.
    """
    regions, count = 0, over.counts[ROWS]
    rows = over.rows[:count]
    keys, turned = np.zeros(count, dtype=np.uint64), np.zeros(count, dtype=np.uint64)
    has_cut = np.zeros(count, dtype=np.bool_)
    for row in range(count):
        root = region_of(over.lines, row)
        x, y = rows[row]
        y = y - darts if y >= 0 else y
        keys[root] += pair_hash(x, y)
        if same:
            turned[root] += pair_hash(y, x)
        has_cut[root] |= x >= 0 and y >= 0
    for row in range(count):
        if not has_cut[row] or region_of(over.lines, row) != row:
            continue
        regions += 1
        key = (min(keys[row], turned[row]) if same else keys[row]) | np.uint64(1)
        if contains(listed, key):
            continue
        listed = with_key(listed, filled[LISTED], key)
        pairs = grown(pairs, filled[FOUND] + count)
        for other in range(row, count):
            if region_of(over.lines, other) == row:
                pairs[filled[FOUND], 0] = rows[other, 0]
                pairs[filled[FOUND], 1] = rows[other, 1] - darts if rows[other, 1] >= 0 else -1
                filled[FOUND] += 1
        filled[LISTED] += 1
        starts = grown(starts, filled[LISTED] + 1)
        starts[filled[LISTED], 0] = filled[FOUND]
    return pairs, starts, listed, regions
