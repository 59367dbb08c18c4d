"""Partial symmetries: two graphs laid upon each other from a pair of darts on, as far as they agree (substructures
§4.3.1, §4.3.2), and the regions in which they do not."""

from __future__ import annotations

import numba
import numpy as np

__all__ = ["CONFLICTS", "DEFECTS", "cut_off", "find_root", "lay_over", "regions"]

CONFLICTS, DEFECTS = 0, 1
"""Places in `counts`: parts that were met again in another place, and pairs of parts that a dummy edge would match."""


@numba.njit(cache=True)
def _agree(a, b, d, e, by_docking):
    """Whether the edges of darts d and e are of one kind, as far as dockings tell."""
    return not by_docking or (a.labels[d] == b.labels[e] and a.labels[a.twins[d]] == b.labels[b.twins[e]])


@numba.njit(cache=True)
def _match(a, b, d, e, dummies, image, owner, partner, sources, defects, counts):
    """Lay the tail of dart e upon that of d, dart upon dart in their order; whether that could be done.

    A row (d, e, side, place) of `dummies` says that, arriving there, one dart is passed over.
    """
    v, w = a.tails[d], b.tails[e]
    first, second = a.starts[v + 1] - a.starts[v], b.starts[w + 1] - b.starts[w]
    if a.types[v] != b.types[w]:
        return False
    if image[v] >= 0 or owner[w] >= 0:
        counts[CONFLICTS] += 1
        return False
    side, place = -1, -1
    if first != second:
        for k in range(len(dummies)):
            if dummies[k, 0] == d and dummies[k, 1] == e:
                side, place = dummies[k, 2], dummies[k, 3]
        if side < 0:
            if abs(first - second) == 1 and counts[DEFECTS] < len(defects):
                defects[counts[DEFECTS], 0] = d
                defects[counts[DEFECTS], 1] = e
                counts[DEFECTS] += 1
            return False
    image[v] = w
    owner[w] = v
    i, j = 0, 0
    while i < first and j < second:
        if side == 0 and i == place:
            i += 1
            side = -1
            continue
        if side == 1 and j == place:
            j += 1
            side = -1
            continue
        x = a.starts[v] + (d - a.starts[v] + i) % first
        y = b.starts[w] + (e - b.starts[w] + j) % second
        partner[x] = y
        sources[y] = x
        i += 1
        j += 1
    return True


@numba.njit(cache=True)
def lay_over(a, b, d, e, by_docking, dummies, image, owner, partner, sources, queue, defects, counts):
    """The greatest partial symmetry of graphs a and b that lays dart e of b upon dart d of a; how many parts it has.

    dummies int64 (q, 4): dummy edges of the dual (§4.4), which pass over what does not agree. Either (d, e, 0 or 1,
    place), where the order of docking sites has one more in a or in b, or (x, y, -1, 0), darts beyond an unmatched
    region, from which the symmetry goes on; it has no part at all where it cannot.

    Fills image (a.n,) and owner (b.n,), nodes of the other graph or -1, partner (2 a.m,) and sources (2 b.m,), darts of
    the other graph or -1. Breadth-first, so that where a way round leads elsewhere the nearer match stands.
    """
    image[:] = -1
    owner[:] = -1
    partner[:] = -1
    sources[:] = -1
    counts[:] = 0
    if not _match(a, b, d, e, dummies, image, owner, partner, sources, defects, counts):
        return 0
    queue[0] = a.tails[d]
    tail = _spread(a, b, 0, 1, by_docking, dummies, image, owner, partner, sources, queue, defects, counts)
    for k in range(len(dummies)):
        if dummies[k, 2] >= 0:
            continue
        x, y = dummies[k, 0], dummies[k, 1]
        if not _match(a, b, x, y, dummies, image, owner, partner, sources, defects, counts):
            return 0
        queue[tail] = a.tails[x]
        tail = _spread(
            a, b, tail, tail + 1, by_docking, dummies, image, owner, partner, sources, queue, defects, counts
        )
    return tail


@numba.njit(cache=True)
def _spread(a, b, head, tail, by_docking, dummies, image, owner, partner, sources, queue, defects, counts):
    """Go on from the matched nodes `queue[head:tail]` of a to all that they lead to; the new end of the queue."""
    while head < tail:
        v = queue[head]
        head += 1
        for x in range(a.starts[v], a.starts[v + 1]):
            y = partner[x]
            if y < 0 or not _agree(a, b, x, y, by_docking):
                continue
            back, ahead = a.twins[x], b.twins[y]
            if partner[back] == ahead:
                continue
            if _match(a, b, back, ahead, dummies, image, owner, partner, sources, defects, counts):
                queue[tail] = a.tails[back]
                tail += 1
    return tail


@numba.njit(cache=True)
def find_root(leader, i):
    """The leader of an item's region."""
    while leader[i] != i:
        leader[i] = leader[leader[i]]
        i = leader[i]
    return i


@numba.njit(cache=True)
def _join(leader, i, j):
    i, j = find_root(leader, i), find_root(leader, j)
    leader[max(i, j)] = min(i, j)


@numba.njit(cache=True)
def regions(a, b, by_docking, image, owner, partner, sources, leader, is_cut):
    """The unmatched regions of a partial symmetry, as sets of what hangs together in either graph.

    Items of `leader` (2 a.m + 2 b.m + a.n + b.n,) are the darts of a, the darts of b, the nodes of a and those of b; it
    comes out with one leader for each region. is_cut (2 a.m,) comes out true for the darts of a along which regions are
    cut off: those that are matched and whose edges are not.
    """
    darts, other = len(a.tails), len(b.tails)
    nodes = darts + other
    for i in range(len(leader)):
        leader[i] = i
    for x in range(darts):
        y = partner[x]
        is_cut[x] = y >= 0 and not (partner[a.twins[x]] == b.twins[y] and _agree(a, b, x, y, by_docking))
    for x in range(darts):
        v, t = a.tails[x], a.twins[x]
        if image[v] < 0:
            if image[a.tails[t]] < 0:
                _join(leader, nodes + v, nodes + a.tails[t])
        elif is_cut[x] or partner[x] < 0:
            if image[a.tails[t]] < 0:
                _join(leader, x, nodes + a.tails[t])
            elif is_cut[t]:
                _join(leader, x, t)
    first = nodes + len(a.types)
    for y in range(other):
        w, t = b.tails[y], b.twins[y]
        x = sources[y]
        if owner[w] < 0:
            if owner[b.tails[t]] < 0:
                _join(leader, first + w, first + b.tails[t])
        elif x < 0 or is_cut[x]:
            here = darts + y if x < 0 else x
            if owner[b.tails[t]] < 0:
                _join(leader, here, first + b.tails[t])
            elif sources[t] >= 0 and is_cut[sources[t]]:
                _join(leader, here, sources[t])


@numba.njit(cache=True)
def cut_off(graph, cut):
    """What the darts `cut` int64 (b,) point to and what hangs together with it without crossing them, bool (n,)."""
    inside, is_wall = np.zeros(len(graph.types), dtype=np.bool_), np.zeros(len(graph.tails), dtype=np.bool_)
    waiting = np.empty(len(cut) + len(graph.tails), dtype=np.int64)
    count = 0
    for dart in cut:
        if dart >= 0:
            is_wall[dart] = True
    for dart in cut:
        if dart >= 0 and not is_wall[graph.twins[dart]]:
            waiting[count] = graph.tails[graph.twins[dart]]
            count += 1
    for dart in cut:
        if dart >= 0:
            is_wall[graph.twins[dart]] = True
    while count > 0:
        count -= 1
        node = waiting[count]
        if inside[node]:
            continue
        inside[node] = True
        for dart in range(graph.starts[node], graph.starts[node + 1]):
            if not is_wall[dart]:
                waiting[count] = graph.tails[graph.twins[dart]]
                count += 1
    return inside
