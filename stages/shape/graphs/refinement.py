"""Colour refinement: the coarsest equitable partition of a coloured graph, with its cells in a canonical order.

Numba compiles this module when it is imported: import it inside functions.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np

from stages.shape.geometry.sorting import sort_order, sort_values


class _Partition(NamedTuple):
    """Nodes in cells, all int64 (n,).

    order: nodes, cell by cell
    position: position of each node in `order`
    start: by position, where its cell begins
    size: size of the cell, where a cell begins
    """

    order: np.ndarray
    position: np.ndarray
    start: np.ndarray
    size: np.ndarray


@numba.njit(cache=True)
def refine(colors, edges, forward, backward, classes):
    """Return the equitable refinement of a colouring: `(order, start)`, both int64 (n,).

    colors: int64 (n,)
    edges: a simple graph, int64 (m, 2)
    forward, backward: class (0 to `classes` - 1) of the arc from `edges[:, 0]` to `edges[:, 1]`, and of the arc back,
        int64 (m,)

    Nodes of one cell have, for each cell and each class of arc, equally many neighbours in that cell over arcs of that
    class. `order` lists the nodes cell by cell. `start[k]` is the position at which the cell of `order[k]` begins.
    Isomorphic graphs get the same cells in the same order. The order inside a cell means nothing.
    """
    n, m = len(colors), len(edges)
    first, source, kind = _arcs(n, edges, forward, backward)
    partition = _partition(colors)
    order, start, size = partition.order, partition.start, partition.size
    queue, waiting = np.empty(n, dtype=np.int64), np.zeros(n, dtype=np.bool_)
    head, queued, cells = 0, 0, 0
    for k in range(n):
        if start[k] == k:
            queued = _wait(queue, waiting, head, queued, k)
            cells += 1
    members = np.empty(2 * m, dtype=np.int64), np.empty(2 * m, dtype=np.int64)
    newest = np.full(classes, -1, dtype=np.int64)
    used = np.empty(classes, dtype=np.int64)
    count = np.zeros(n, dtype=np.int64)  # by node: arcs of one class into the splitting cell
    touched = np.empty(n, dtype=np.int64)
    moved = np.zeros(n, dtype=np.int64)  # by cell: how many of its nodes are touched
    parted = np.empty(n, dtype=np.int64)
    while queued > 0 and cells < n:
        splitter = queue[head]
        head = (head + 1) % n
        queued -= 1
        waiting[splitter] = False
        nodes = order[splitter : splitter + size[splitter]]
        kinds = _arcs_by_class(nodes, first, source, kind, members, newest, used)
        for c in used[:kinds]:
            reached, broken = _touch(partition, members, newest[c], count, touched, moved, parted)
            newest[c] = -1
            for cell in parted[:broken]:
                end = cell + size[cell]
                low = end - moved[cell]
                moved[cell] = 0
                if size[cell] == 1:
                    continue
                _sort_by_count(partition, count, low, end)
                pieces, largest = _split(partition, count, cell, low)
                cells += pieces - 1
                # of a cell that does not wait, the largest piece need not wait
                was_waiting = waiting[cell]
                begin = cell
                while begin < end:
                    if not waiting[begin] and (was_waiting or begin != largest):
                        queued = _wait(queue, waiting, head, queued, begin)
                    begin += size[begin]
            for k in range(reached):
                count[touched[k]] = 0
    return order, start


@numba.njit(cache=True)
def _arcs(n, edges, forward, backward):
    """Return the arcs into each node: those into `v` come from `source[first[v]:first[v + 1]]` with the classes `kind`
    there.
    """
    m = len(edges)
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
    return first, source, kind


@numba.njit(cache=True)
def _partition(colors):
    """Return the cells of a colouring, by colour."""
    n = len(colors)
    order = sort_order(colors)
    position = np.empty(n, dtype=np.int64)
    start = np.zeros(n, dtype=np.int64)
    size = np.zeros(n, dtype=np.int64)
    for k in range(n):
        position[order[k]] = k
        start[k] = k if k == 0 or colors[order[k]] != colors[order[k - 1]] else start[k - 1]
        size[start[k]] += 1
    return _Partition(order, position, start, size)


@numba.njit(cache=True)
def _wait(queue, waiting, head, queued, cell):
    """Put a cell at the end of the ring `queue`. Returns the number of waiting cells."""
    waiting[cell] = True
    queue[(head + queued) % len(queue)] = cell
    return queued + 1


@numba.njit(cache=True)
def _arcs_by_class(nodes, first, source, kind, members, newest, used):
    """List the arcs into `nodes` by their classes. Returns the number of classes; they are `used`, ascending.

    Sources go to `members[0]`, the last one of a class at `newest`, and the one before each at `members[1]`, or -1.
    """
    member, older = members
    arcs, kinds = 0, 0
    for v in nodes:
        for arc in range(first[v], first[v + 1]):
            c = kind[arc]
            if newest[c] < 0:
                used[kinds] = c
                kinds += 1
            member[arcs], older[arcs] = source[arc], newest[c]
            newest[c] = arcs
            arcs += 1
    if kinds > 1:
        sort_values(used[:kinds])
    return kinds


@numba.njit(cache=True)
def _touch(partition, members, arc, count, touched, moved, parted):
    """Count the arcs of the list that begins at `arc` by their source nodes, and move these to the end of their cells.

    `count` holds the counts by node, `moved` the number of moved nodes by cell. Returns the number of `touched` nodes
    and of `parted` cells, ascending.
    """
    order, position, start, size = partition
    member, older = members
    reached, broken = 0, 0
    while arc >= 0:
        v = member[arc]
        if count[v] == 0:
            touched[reached] = v
            reached += 1
            cell = start[position[v]]
            if moved[cell] == 0:
                parted[broken] = cell
                broken += 1
            moved[cell] += 1
            target = cell + size[cell] - moved[cell]
            other, index = order[target], position[v]
            order[index], position[other] = other, index
            order[target], position[v] = v, target
        count[v] += 1
        arc = older[arc]
    if broken > 1:
        sort_values(parted[:broken])
    return reached, broken


@numba.njit(cache=True)
def _split(partition, count, cell, low):
    """Cut a cell wherever the count of its nodes changes; the first counted node is at `low`.

    Returns the number of pieces and where the largest starts, the first of equals.
    """
    order, _, start, size = partition
    end = cell + size[cell]
    begin, largest, pieces = cell, cell, 1
    for k in range(cell, end):
        if k > cell and (k == low or (k > low and count[order[k]] != count[order[k - 1]])):
            size[begin] = k - begin
            if size[begin] > size[largest]:
                largest = begin
            begin = k
            pieces += 1
        start[k] = begin
    size[begin] = end - begin
    if size[begin] > size[largest]:
        largest = begin
    return pieces, largest


@numba.njit(cache=True)
def _sort_by_count(partition, count, low, end):
    """Sort the nodes at the positions from `low` to `end` by their counts."""
    order, position, _, _ = partition
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
        index = begins[count[v]]
        begins[count[v]] += 1
        order[index], position[v] = v, index
