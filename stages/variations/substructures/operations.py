"""All graph operations between two graphs, each once, in normal form (substructures §4.3, §4.4)."""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from stages.variations.kernels.lookup import mix
from stages.variations.substructures.ordered import OrderedGraph
from stages.variations.substructures.symmetry import CONFLICTS, DEFECTS, find_root, lay_over, regions

__all__ = ["Operations", "find_operations"]

MOST_DEFECTS = 64
"""Defects of one partial symmetry that dummy edges are tried on."""
DUMMY_WORK = 10_000_000
"""Darts and pairs of them looked at for symmetries with dummy edges, which are for sparse outliers: in dense graphs the
rest is left. It bounds memory too, for what is still to be laid over is counted when it is put on the stack."""


@dataclass(frozen=True)
class Operations:
    """Operations that replace a piece of one graph by a piece of another, each the other way round too.

    pairs: int64 (p, 2), darts of the first and of the second graph, each pointing from what stays into what is
    replaced; the rows of an operation are its boundary. A row (d, -1) or (-1, e) is a dart that a dummy edge passes
    over: it loses what it points to. starts: int64 (k + 1,), the rows of each of k operations. work: how many darts,
    and pairs of them, were looked at to find them.
    """

    pairs: np.ndarray
    starts: np.ndarray
    work: int

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
    in which the search is exponential. by_docking: whether edges match by their dockings too, not by types alone.

    Without violations each is found from a pair of darts, so there are at most as many as pairs: O(k² n²), and in
    practice far below k n². A symmetry that meets no part twice is the same from all its pairs and is found once.
    """
    return Operations(*_enumerate(a, b, a is b, by_docking, violations))


@numba.njit(cache=True)
def _grown(array, needed):
    """The array, or one of at least `needed` rows that begins like it."""
    if needed <= len(array):
        return array
    larger = np.empty((max(2 * len(array), needed), array.shape[1]), dtype=array.dtype)
    larger[: len(array)] = array
    return larger


@numba.njit(cache=True)
def _is_new(table, key):
    """Put a key into an open-addressing table; whether it was not there."""
    slot = key & np.uint64(len(table) - 1)
    while table[slot] != 0:
        if table[slot] == key:
            return False
        slot = (slot + np.uint64(1)) & np.uint64(len(table) - 1)
    table[slot] = key
    return True


@numba.njit(cache=True)
def _room(a, b):
    """What the symmetries of two graphs are laid out in."""
    darts, other, nodes, others = len(a.tails), len(b.tails), len(a.types), len(b.types)
    return (
        np.empty(nodes, dtype=np.int64),
        np.empty(others, dtype=np.int64),
        np.empty(darts, dtype=np.int64),
        np.empty(other, dtype=np.int64),
        np.empty(nodes, dtype=np.int64),
        np.empty((MOST_DEFECTS, 2), dtype=np.int64),
        np.zeros(2, dtype=np.int64),
        np.empty(darts + other + nodes + others, dtype=np.int64),
        np.empty(darts, dtype=np.bool_),
    )


@numba.njit(cache=True)
def _pair_hash(x, y):
    """A hash of a pair of darts, or of one and -1."""
    return mix(np.uint64(x + 1) * np.uint64(0x9E3779B97F4A7C15) + np.uint64(y + 2))


@numba.njit(cache=True)
def _enumerate(a, b, same, by_docking, violations):
    """Rows and starts of all operations between a and b, `same` where they are one graph, and the work."""
    darts, other = len(a.tails), len(b.tails)
    room = _room(a, b)
    visited = np.zeros((darts, other), dtype=np.bool_)
    table = np.zeros(1 << 12, dtype=np.uint64)
    pairs = np.empty((256, 2), dtype=np.int64)
    starts = np.zeros((256, 1), dtype=np.int64)
    filled = np.zeros(2, dtype=np.int64)
    stack = np.empty((256, violations, 4), dtype=np.int64)
    depths = np.empty(256, dtype=np.int64)
    plain, work = darts * other, np.zeros(1, dtype=np.int64)
    for trivial in range(2):
        for d in range(darts):
            for e in range(d + 1 if same else 0, other):
                if visited[d, e] or _is_trivial(a, b, d, e, by_docking) != (trivial == 1):
                    continue
                if not _is_alike(a, b, d, e):
                    continue
                depths[0] = 0
                waiting = 1
                plain += darts + other
                while waiting > 0:
                    waiting -= 1
                    depth = depths[waiting]
                    dummies = stack[waiting, :depth].copy()
                    _lay(a, b, d, e, by_docking, dummies, room, visited)
                    pairs, starts, table = _emit(a, b, same, by_docking, room, pairs, starts, table, filled)
                    if depth < violations:
                        for k in range(room[6][DEFECTS]):
                            stack, depths, waiting = _pass_over(a, b, room[5][k], dummies, stack, depths, waiting, work)
                        stack, depths, waiting = _jump(a, b, room, dummies, stack, depths, waiting, work)
    return pairs[: filled[0]].copy(), starts[: filled[1] + 1, 0].copy(), plain + work[0]


@numba.njit(cache=True)
def _is_alike(a, b, d, e):
    """Whether the darts start from nodes of one type and one number of docking sites."""
    v, w = a.tails[d], b.tails[e]
    return a.types[v] == b.types[w] and a.starts[v + 1] - a.starts[v] == b.starts[w + 1] - b.starts[w]


@numba.njit(cache=True)
def _is_trivial(a, b, d, e, by_docking):
    """Whether the edges of two darts match at both ends: no cut need pass through them."""
    if by_docking and (a.labels[d] != b.labels[e] or a.labels[a.twins[d]] != b.labels[b.twins[e]]):
        return False
    return _is_alike(a, b, a.twins[d], b.twins[e])


@numba.njit(cache=True)
def _lay(a, b, d, e, by_docking, dummies, room, visited):
    """Lay b over a from a pair of darts on, and tick off the pairs from which the same would come."""
    image, owner, partner, sources, queue, defects, counts, leader, is_cut = room
    found = lay_over(a, b, d, e, by_docking, dummies, image, owner, partner, sources, queue, defects, counts)
    if counts[CONFLICTS] == 0 and len(dummies) == 0:
        for k in range(found):
            for x in range(a.starts[queue[k]], a.starts[queue[k] + 1]):
                visited[x, partner[x]] = True
    regions(a, b, by_docking, image, owner, partner, sources, leader, is_cut)


@numba.njit(cache=True)
def _pass_over(a, b, defect, dummies, stack, depths, waiting, work):
    """Put on the stack each way to pass over one docking site where two orders of them do not agree."""
    v, w = a.tails[defect[0]], b.tails[defect[1]]
    first, second = a.starts[v + 1] - a.starts[v], b.starts[w + 1] - b.starts[w]
    for place in range(1, max(first, second)):
        if work[0] >= DUMMY_WORK:
            break
        work[0] += len(a.tails) + len(b.tails)
        row = (defect[0], defect[1], 0 if first > second else 1, place)
        stack, depths, waiting = _push(stack, depths, waiting, dummies, row)
    return stack, depths, waiting


@numba.njit(cache=True)
def _jump(a, b, room, dummies, stack, depths, waiting, work):
    """Put on the stack each way to go on beyond an unmatched region, at dual nodes at a distance of at most two in one
    graph and of one in the other from a cut of the symmetry in hand."""
    image, owner, partner, _, _, _, _, _, is_cut = room
    for d in range(len(a.tails)):
        if work[0] >= DUMMY_WORK:
            break
        if not is_cut[d] or image[a.tails[a.twins[d]]] >= 0 or owner[b.tails[b.twins[partner[d]]]] >= 0:
            continue
        near, far = _beyond(a, d, image)
        near_there, far_there = _beyond(b, partner[d], owner)
        work[0] += len(far) + len(far_there)
        for xs, ys in ((near, near_there), (near, far_there), (far, near_there)):
            for x in xs:
                for y in ys:
                    if work[0] >= DUMMY_WORK:
                        return stack, depths, waiting
                    work[0] += 1
                    if _is_alike(a, b, x, y):
                        work[0] += len(a.tails) + len(b.tails)
                        stack, depths, waiting = _push(stack, depths, waiting, dummies, (x, y, -1, 0))
    return stack, depths, waiting


@numba.njit(cache=True)
def _beyond(graph, dart, matched):
    """The darts that point from unmatched nodes to the node where `dart` leads to, and to its unmatched neighbours."""
    near, far = [np.int64(0) for _ in range(0)], [np.int64(0) for _ in range(0)]
    hole = graph.tails[graph.twins[dart]]
    for x in range(graph.starts[hole], graph.starts[hole + 1]):
        back = graph.twins[x]
        other = graph.tails[back]
        if matched[other] >= 0:
            continue
        near.append(back)
        for y in range(graph.starts[other], graph.starts[other + 1]):
            end = graph.tails[graph.twins[y]]
            if y != back and end != hole and matched[end] < 0:
                far.append(graph.twins[y])
    return near, far


@numba.njit(cache=True)
def _push(stack, depths, waiting, dummies, row):
    """Put `dummies` and one more row on the stack."""
    if waiting == len(depths):
        larger = np.empty((2 * waiting, stack.shape[1], 4), dtype=np.int64)
        larger[:waiting] = stack
        stack = larger
        longer = np.empty(2 * waiting, dtype=np.int64)
        longer[:waiting] = depths
        depths = longer
    stack[waiting, : len(dummies)] = dummies
    stack[waiting, len(dummies)] = row
    depths[waiting] = len(dummies) + 1
    return stack, depths, waiting + 1


@numba.njit(cache=True)
def _emit(a, b, same, by_docking, room, pairs, starts, table, filled):
    """Add the regions of the symmetry in hand that are new, by a hash of their boundaries."""
    image, owner, partner, sources, _, _, _, leader, is_cut = room
    darts, other = len(a.tails), len(b.tails)
    keys, turned = np.zeros(len(leader), dtype=np.uint64), np.zeros(len(leader), dtype=np.uint64)
    has_cut = np.zeros(len(leader), dtype=np.bool_)
    rows = np.empty((darts + other, 3), dtype=np.int64)
    count = 0
    for x in range(darts):
        is_spare = image[a.tails[x]] >= 0 and partner[x] < 0
        if is_cut[x] or is_spare:
            root = find_root(leader, x)
            y = partner[x]
            keys[root] += _pair_hash(x, y)
            turned[root] += _pair_hash(y, x)
            has_cut[root] |= is_cut[x]
            rows[count] = (root, x, y)
            count += 1
    for y in range(other):
        if owner[b.tails[y]] >= 0 and sources[y] < 0:
            root = find_root(leader, darts + y)
            keys[root] += _pair_hash(-1, y)
            turned[root] += _pair_hash(y, -1)
            rows[count] = (root, -1, y)
            count += 1
    rows = rows[:count]
    for place in np.argsort(rows[:, 0], kind="mergesort"):
        root = rows[place, 0]
        if not has_cut[root]:
            continue
        if keys[root] != 0:
            key = min(keys[root], turned[root]) if same else keys[root]
            keys[root] = 0
            if 2 * (filled[1] + 1) > len(table):
                table = _rehashed(table)
            turned[root] = np.uint64(1) if _is_new(table, key | np.uint64(1)) else np.uint64(0)
            if turned[root] == 1:
                filled[1] += 1
        if turned[root] == 1:
            pairs = _grown(pairs, filled[0] + 1)
            pairs[filled[0]] = rows[place, 1:]
            filled[0] += 1
            starts = _grown(starts, filled[1] + 1)
            starts[filled[1], 0] = filled[0]
    return pairs, starts, table


@numba.njit(cache=True)
def _rehashed(table):
    """The keys of a table in one of twice its size."""
    larger = np.zeros(2 * len(table), dtype=np.uint64)
    for key in table:
        if key != 0:
            _is_new(larger, key)
    return larger
