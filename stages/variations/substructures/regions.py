"""The unmatched regions of a partial symmetry: what can be replaced by what (substructures §4.3.1)."""

from __future__ import annotations

import numba
import numpy as np

from stages.variations.substructures.partial_symmetry import MATCHED, ROWS, WORK, agree

LEADER, FIRST, LAST, LIVE = range(4)
"""Columns of `lines`."""
FROM, AFTER, REACHED = range(3)
"""Columns of `marks`."""


@numba.njit(cache=True)
def region_of(lines, row):
    """Return the first row of a row's region."""
    while lines[row, LEADER] != row:
        lines[row, LEADER] = lines[lines[row, LEADER], LEADER]
        row = lines[row, LEADER]
    return row


@numba.njit(cache=True)
def find_regions(graph, by_docking, over):
    """Find the boundary of the current symmetry, `rows`, and which rows are of one unmatched region.

    A row is (x, y), darts that are matched and whose edges are not, or a dart that a dummy edge passed over, (x, -1) or
    (-1, y). What is connected in either graph without its matched nodes is one region. It is explored from all rows in
    turn, a node at a time, until all but one region have come to an end: a symmetry of few parts costs little, however
    large the rest.
    """
    _find_rows(graph, by_docking, over)
    rows, row_of, lines, marks = over.rows[: over.counts[ROWS]], over.row_of, over.lines, over.marks
    reached = _begin(graph, over)
    live = 0
    for row in range(len(rows)):
        if lines[row, LEADER] == row and lines[row, FIRST] >= 0:
            lines[live, LIVE] = row
            live += 1
    while live > 1:
        still_live = 0
        for k in range(live):
            row = lines[k, LIVE]
            if lines[row, LEADER] == row and lines[row, FIRST] >= 0:
                lines[still_live, LIVE] = row
                still_live += 1
                node = lines[row, FIRST]
                lines[row, FIRST] = marks[node, AFTER]
                over.counts[WORK] += graph.starts[node + 1] - graph.starts[node]
                for x in range(graph.starts[node], graph.starts[node + 1]):
                    head = graph.tails[graph.twins[x]]
                    if over.image[head] < 0:
                        reached = _reach(head, row, reached, lines, marks)
        live = still_live
    for k in range(reached):
        marks[marks[k, REACHED], FROM] = -1
    for row in range(len(rows)):
        for x in rows[row]:
            if x >= 0:
                row_of[x] = -1


@numba.njit(cache=True)
def _find_rows(graph, by_docking, over):
    count, partner, rows = 0, over.partner, over.rows
    for k in range(over.counts[MATCHED]):
        v = over.queue[k]
        w = over.image[v]
        for x in range(graph.starts[v], graph.starts[v + 1]):
            y = partner[x]
            if y < 0 or partner[graph.twins[x]] != graph.twins[y] or not agree(graph, x, y, by_docking):
                rows[count, 0] = x
                rows[count, 1] = y
                over.row_of[x] = count
                if y >= 0:
                    over.row_of[y] = count
                count += 1
        if graph.starts[w + 1] - graph.starts[w] <= graph.starts[v + 1] - graph.starts[v]:
            continue
        for y in range(graph.starts[w], graph.starts[w + 1]):
            if partner[y] < 0:
                rows[count, 0] = -1
                rows[count, 1] = y
                over.row_of[y] = count
                count += 1
    over.counts[ROWS] = count


@numba.njit(cache=True)
def _begin(graph, over):
    """Reach what the rows lead to; return how many nodes were reached."""
    reached, rows, row_of, lines = np.int64(0), over.rows, over.row_of, over.lines
    for row in range(over.counts[ROWS]):
        lines[row, LEADER] = row
        lines[row, FIRST] = -1
    for row in range(over.counts[ROWS]):
        for x in rows[row]:
            if x < 0:
                continue
            back = graph.twins[x]
            head = graph.tails[back]
            if over.image[head] < 0:
                reached = _reach(head, row, reached, lines, over.marks)
            elif row_of[back] >= 0 and (over.partner[x] >= 0 or over.partner[back] >= 0):
                _join(row, row_of[back], lines, over.marks)
    return reached


@numba.njit(cache=True)
def _reach(node, row, reached, lines, marks):
    """Reach a node from a row's region: it waits there, or joins two regions; return how many were reached."""
    if marks[node, FROM] >= 0:
        _join(marks[node, FROM], row, lines, marks)
        return reached
    root = region_of(lines, row)
    marks[node, FROM] = root
    marks[node, AFTER] = -1
    marks[reached, REACHED] = node
    if lines[root, FIRST] < 0:
        lines[root, FIRST] = node
    else:
        marks[lines[root, LAST], AFTER] = node
    lines[root, LAST] = node
    return reached + 1


@numba.njit(cache=True)
def _join(i, j, lines, marks):
    """Make one region of two, and one line of what waits in them."""
    i, j = region_of(lines, i), region_of(lines, j)
    if i == j:
        return
    i, j = min(i, j), max(i, j)
    lines[j, LEADER] = i
    if lines[j, FIRST] >= 0:
        if lines[i, FIRST] < 0:
            lines[i, FIRST] = lines[j, FIRST]
        else:
            marks[lines[i, LAST], AFTER] = lines[j, FIRST]
        lines[i, LAST] = lines[j, LAST]
        lines[j, FIRST] = -1


@numba.njit(cache=True)
def cut_off(graph, cut):
    """Return what the darts `cut` int64 (b,) point to and what is connected to it without crossing, bool (n,)."""
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
