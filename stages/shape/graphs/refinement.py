"""Colour refinement: the coarsest equitable partition of a coloured graph, with its cells in a canonical order.

Numba compiles this module when it is imported: import it inside functions.
"""

from __future__ import annotations

import numba
import numpy as np

__all__ = ["refine"]


@numba.njit(cache=True)
def refine(colors, edges, forward, backward, classes):
    """The equitable refinement of a colouring: `(order, start)`, both int64 (n,).

    Nodes of one cell have, for each cell and each class of arc, equally many neighbours in that cell over arcs of
    that class. `order` lists the nodes cell by cell; `start[k]` is the position at which the cell of `order[k]`
    begins. Isomorphic graphs get the same cells in the same order; the order inside a cell means nothing.

    colors: int64 (n,); edges: int64 (m, 2), a simple graph; forward, backward: int64 (m,), the class (0 to
    `classes` - 1) of the arc from `edges[:, 0]` to `edges[:, 1]`, and of the arc back.
    """
    n, m = len(colors), len(edges)
    # arcs into each node, as the node they come from and their class
    first = np.zeros(n + 1, dtype=np.int64)
    for k in range(m):
        first[edges[k, 0] + 1] += 1
        first[edges[k, 1] + 1] += 1
    for v in range(n):
        first[v + 1] += first[v]
    fill = first[:n].copy()
    source = np.empty(2 * m, dtype=np.int64)
    kind = np.empty(2 * m, dtype=np.int64)
    for k in range(m):
        i, j = edges[k, 0], edges[k, 1]
        source[fill[j]], kind[fill[j]] = i, forward[k]
        fill[j] += 1
        source[fill[i]], kind[fill[i]] = j, backward[k]
        fill[i] += 1

    order = np.argsort(colors, kind="mergesort")
    position = np.empty(n, dtype=np.int64)
    start = np.zeros(n, dtype=np.int64)  # by position
    size = np.zeros(n, dtype=np.int64)  # by position at which a cell begins
    waiting = np.zeros(n, dtype=np.bool_)
    queue = np.empty(n, dtype=np.int64)
    head, queued, cells = 0, 0, 0
    for k in range(n):
        position[order[k]] = k
        fresh = k == 0 or colors[order[k]] != colors[order[k - 1]]
        start[k] = k if fresh else start[k - 1]
        size[start[k]] += 1
        if fresh:
            cells += 1
            waiting[k] = True
            queue[queued] = k
            queued += 1

    count = np.zeros(n, dtype=np.int64)  # by node: arcs of one class into the splitting cell
    touched = np.empty(n, dtype=np.int64)
    moved = np.zeros(n, dtype=np.int64)  # by cell: how many of its nodes are touched
    split = np.empty(n, dtype=np.int64)
    newest = np.full(classes, -1, dtype=np.int64)  # arcs into the splitting cell, a list for each class
    older = np.empty(2 * m, dtype=np.int64)
    member = np.empty(2 * m, dtype=np.int64)
    used = np.empty(classes, dtype=np.int64)
    while queued > 0 and cells < n:
        splitter = queue[head]
        head = (head + 1) % n
        queued -= 1
        waiting[splitter] = False
        arcs, kinds = 0, 0
        for k in range(splitter, splitter + size[splitter]):
            for arc in range(first[order[k]], first[order[k] + 1]):
                c = kind[arc]
                if newest[c] < 0:
                    used[kinds] = c
                    kinds += 1
                member[arcs], older[arcs] = source[arc], newest[c]
                newest[c] = arcs
                arcs += 1
        if kinds > 1:
            used[:kinds].sort()
        for c in used[:kinds]:
            reached, parted = 0, 0
            arc = newest[c]
            newest[c] = -1
            while arc >= 0:
                v = member[arc]
                if count[v] == 0:
                    touched[reached] = v
                    reached += 1
                    cell = start[position[v]]
                    if moved[cell] == 0:
                        split[parted] = cell
                        parted += 1
                    # touched nodes gather at the end of their cell
                    moved[cell] += 1
                    target = cell + size[cell] - moved[cell]
                    other, place = order[target], position[v]
                    order[place], position[other] = other, place
                    order[target], position[v] = v, target
                count[v] += 1
                arc = older[arc]
            if parted > 1:
                split[:parted].sort()
            for cell in split[:parted]:
                end = cell + size[cell]
                low = end - moved[cell]
                moved[cell] = 0
                if size[cell] == 1:
                    continue
                _sort_by_count(order, position, count, low, end)
                # cut the cell wherever the count changes; of a cell that does not wait, the largest piece need not wait
                was_waiting = waiting[cell]
                begin, largest = cell, cell
                for k in range(cell, end):
                    if k > cell and (k == low or (k > low and count[order[k]] != count[order[k - 1]])):
                        size[begin] = k - begin
                        if size[begin] > size[largest]:
                            largest = begin
                        begin = k
                        cells += 1
                    start[k] = begin
                size[begin] = end - begin
                if size[begin] > size[largest]:
                    largest = begin
                begin = cell
                while begin < end:
                    if not waiting[begin] and (was_waiting or begin != largest):
                        waiting[begin] = True
                        queue[(head + queued) % n] = begin
                        queued += 1
                    begin += size[begin]
            for k in range(reached):
                count[touched[k]] = 0
    return order, start


@numba.njit(cache=True)
def _sort_by_count(order, position, count, low, end):
    """Sort `order[low:end]` by the counts of its nodes."""
    top = 0
    for k in range(low, end):
        top = max(top, count[order[k]])
    if top == 1:
        return
    begins = np.zeros(top + 1, dtype=np.int64)
    for k in range(low, end):
        begins[count[order[k]]] += 1
    total = low
    for value in range(top + 1):
        begins[value], total = total, total + begins[value]
    nodes = order[low:end].copy()
    for v in nodes:
        place = begins[count[v]]
        begins[count[v]] += 1
        order[place], position[v] = v, place
