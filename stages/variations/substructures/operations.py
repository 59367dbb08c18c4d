"""All graph operations between two graphs, each once, in normal form (substructures §4.3, §4.4)."""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from stages.variations.substructures.dummies import is_alike, pass_over
from stages.variations.substructures.keys import grown, holds, with_key
from stages.variations.substructures.ordered import OrderedGraph
from stages.variations.substructures.regions import find_regions, region_of
from stages.variations.substructures.symmetry import (
    CONFLICTS,
    MATCHED,
    ROWS,
    WORK,
    lay_over,
    lift,
    overlay,
    pair_hash,
    side_by_side,
)

__all__ = ["DUMMY_WORK", "MOST_WAITING", "Operations", "find_operations"]

DUMMY_WORK = 3_000_000
"""Darts that are looked at for symmetries with dummy edges, which are for sparse outliers, about a fifth of a second:
in dense graphs the rest is left, those with most dummy edges first."""
MOST_WAITING = 1 << 17
"""Symmetries with dummy edges that are laid over, and wait to be, at most: what bounds memory."""
FOUND, LISTED, KNOWN, MET = range(4)
"""Places in `filled`: rows, operations, and keys of symmetries and of pairs of darts."""


@dataclass(frozen=True)
class Operations:
    """Operations that replace a piece of one graph by a piece of another, each the other way round too.

    pairs: int64 (p, 2), darts of the first and of the second graph, each pointing from what stays into what is
    replaced; the rows of an operation are its boundary. A row (d, -1) or (-1, e) is a dart that a dummy edge passes
    over: it loses what it points to. starts: int64 (k + 1,), the rows of each of k operations. plain: how many of them,
    the first, need no dummy edge. work: how many darts were looked at to find them. is_whole: whether these are all;
    else a limit on what is looked at with dummy edges was met, and the plain ones are all.
    """

    pairs: np.ndarray
    starts: np.ndarray
    plain: int
    work: int
    is_whole: bool

    def __len__(self) -> int:
        return len(self.starts) - 1

    def boundary(self, number: int) -> np.ndarray:
        """The boundary of one operation, int64 (b, 2)."""
        rows: np.ndarray = self.pairs[self.starts[number] : self.starts[number + 1]]
        return rows


def find_operations(a: OrderedGraph, b: OrderedGraph, violations: int = 0, by_docking: bool = False) -> Operations:
    """All operations between a piece of `a` and a piece of `b`, which may be the same graph.

    An operation is one unmatched region of a greatest partial symmetry, so no pair of parts that are alike can be left
    out at its boundary. violations: how many dummy edges a symmetry may use at most, 0 to 3 (§4.4, "robust matching"),
    in which the search is exponential; those with fewer come first. by_docking: whether edges match by their dockings
    too, not by types alone.

    Without violations each is found from a pair of darts, so there are at most as many as pairs: O(k² n²), and in
    practice far below k n². A symmetry that meets no part twice is the same from all its pairs and is found once, and
    none costs more than it and the smaller regions that it leaves are large.
    """
    return Operations(*_enumerate(side_by_side(a, b), len(a.tails), a is b, by_docking, violations))


@numba.njit(cache=True)
def _enumerate(graph, darts, same, by_docking, violations):
    """Rows and starts of all operations between two graphs side by side, of which the first has so many darts, `same`
    where they are one graph; how many are plain; the work; and whether these are all."""
    over = overlay(len(graph.types), len(graph.tails))
    visited = np.zeros((darts, len(graph.tails) - darts), dtype=np.bool_)
    known, met = np.zeros(1 << 10, dtype=np.uint64), np.zeros(1 << 10, dtype=np.uint64)
    pairs, starts = np.empty((256, 2), dtype=np.int64), np.zeros((256, 1), dtype=np.int64)
    listed, filled = np.zeros(1 << 10, dtype=np.uint64), np.zeros(4, dtype=np.int64)
    waiting, before = np.empty((256, 3 + 4 * violations), dtype=np.int64), np.empty((256, 1), dtype=np.uint64)
    taken, tail, is_whole, plain, plain_work = 0, 0, True, -1, 0
    d, e = 0, darts if same else darts - 1
    while True:
        depth, parent = 0, np.uint64(0)
        if d < darts:
            e += 1
            if e >= len(graph.tails):
                d, e = d + 1, darts + d + 1 if same else darts - 1
                continue
            if visited[d, e - darts] or not is_alike(graph, d, e):
                continue
            start, image = d, e
        else:
            if plain < 0:
                plain, plain_work = filled[LISTED], over.counts[WORK]
            if taken == tail:
                break
            if over.counts[WORK] - plain_work >= DUMMY_WORK:
                is_whole = False
                break
            start, image, depth, parent = waiting[taken, 0], waiting[taken, 1], waiting[taken, 2], before[taken, 0]
            taken += 1
        dummies = waiting[taken - 1, 3 : 3 + 4 * depth].copy().reshape((depth, 4))
        beyond = depth > 0 and dummies[depth - 1, 2] < 0
        if beyond and holds(met, _beyond(parent, dummies[depth - 1, 0], dummies[depth - 1, 1])):
            continue
        key = lay_over(graph, start, image, by_docking, dummies, over)
        if key != 0 and over.counts[CONFLICTS] == 0:
            if depth == 0:
                _visit(graph, darts, over, visited)
            elif beyond:
                met = _meet(graph, parent, dummies[depth - 1, 0], over, met, filled)
        if key != 0 and not holds(known, key):
            known = with_key(known, filled[KNOWN], key)
            filled[KNOWN] += 1
            find_regions(graph, by_docking, over)
            pairs, starts, listed = _emit(darts, same, over, pairs, starts, listed, filled)
            if depth < violations and tail < MOST_WAITING:
                ways = pass_over(graph, over, MOST_WAITING - tail)
                waiting, before = grown(waiting, tail + len(ways)), grown(before, tail + len(ways))
                for k in range(len(ways)):
                    waiting[tail, 0], waiting[tail, 1], waiting[tail, 2] = start, image, depth + 1
                    waiting[tail, 3 : 3 + 4 * depth] = dummies.ravel()
                    waiting[tail, 3 + 4 * depth : 7 + 4 * depth] = ways[k]
                    before[tail, 0] = key
                    tail += 1
            is_whole &= depth == violations or tail < MOST_WAITING
        lift(graph, over)
    return pairs[: filled[FOUND]].copy(), starts[: filled[LISTED] + 1, 0].copy(), plain, over.counts[WORK], is_whole


@numba.njit(cache=True)
def _visit(graph, darts, over, visited):
    """Tick off all pairs of darts from which the symmetry in hand would come again."""
    for k in range(over.counts[MATCHED]):
        for x in range(graph.starts[over.queue[k]], graph.starts[over.queue[k] + 1]):
            visited[x, over.partner[x] - darts] = True


@numba.njit(cache=True)
def _meet(graph, parent, dart, over, met, filled):
    """Tick off all pairs of darts beyond a hole of the symmetry `parent` from which the same would be met as from
    `dart`, which was laid over last."""
    first = over.counts[MATCHED] - 1
    while over.queue[first] != graph.tails[dart]:
        first -= 1
    for k in range(first, over.counts[MATCHED]):
        for x in range(graph.starts[over.queue[k]], graph.starts[over.queue[k] + 1]):
            key = _beyond(parent, x, over.partner[x])
            if not holds(met, key):
                met = with_key(met, filled[MET], key)
                filled[MET] += 1
    return met


@numba.njit(cache=True)
def _beyond(parent, x, y):
    """A key of a symmetry and a pair of darts, never 0."""
    return (parent ^ pair_hash(x, y)) | np.uint64(1)


@numba.njit(cache=True)
def _emit(darts, same, over, pairs, starts, listed, filled):
    """Add the regions of the symmetry in hand that are new, by a hash of their boundaries."""
    count = over.counts[ROWS]
    rows = over.rows[:count]
    keys, turned = np.zeros(count, dtype=np.uint64), np.zeros(count, dtype=np.uint64)
    has_cut = np.zeros(count, dtype=np.bool_)
    for row in range(count):
        root = region_of(over.lines, row)
        x, y = rows[row]
        y = y - darts if y >= 0 else y
        keys[root] += pair_hash(x, y)
        turned[root] += pair_hash(y, x)
        has_cut[root] |= x >= 0 and y >= 0
    for row in range(count):
        if not has_cut[row] or region_of(over.lines, row) != row:
            continue
        key = (min(keys[row], turned[row]) if same else keys[row]) | np.uint64(1)
        if holds(listed, key):
            continue
        listed = with_key(listed, filled[LISTED], key)
        pairs = grown(pairs, filled[FOUND] + count)
        for each in range(row, count):
            if region_of(over.lines, each) == row:
                pairs[filled[FOUND], 0] = rows[each, 0]
                pairs[filled[FOUND], 1] = rows[each, 1] - darts if rows[each, 1] >= 0 else -1
                filled[FOUND] += 1
        filled[LISTED] += 1
        starts = grown(starts, filled[LISTED] + 1)
        starts[filled[LISTED], 0] = filled[FOUND]
    return pairs, starts, listed
