"""Compiled walks over a shape graph: spanning trees, and the token codes of a tree with its cycle edges.

Numba compiles this module when it is imported: import it inside functions.
"""

from __future__ import annotations

import numba
import numpy as np

from stages.shape.geometry.sorting import sort_values


@numba.njit(cache=True)
def _arcs(n, edges, edge_order):
    """Return the arcs out of each node, in `edge_order`: `(first, target, edge)`."""
    first = np.zeros(n + 1, dtype=np.int64)
    for k in range(len(edges)):
        first[edges[k, 0] + 1] += 1
        first[edges[k, 1] + 1] += 1
    for v in range(n):
        first[v + 1] += first[v]
    fill = first[:n].copy()
    target = np.empty(2 * len(edges), dtype=np.int64)
    edge = np.empty(2 * len(edges), dtype=np.int64)
    for k in edge_order:
        for side in range(2):
            v = edges[k, side]
            target[fill[v]], edge[fill[v]] = edges[k, 1 - side], k
            fill[v] += 1
    return first, target, edge


@numba.njit(cache=True)
def first_edges_tree(n, edges, edge_order):
    """Return the spanning forest of edges that close no cycle in `edge_order`, bool (m,)."""
    leader = np.arange(n)
    tree = np.zeros(len(edges), dtype=np.bool_)
    for k in edge_order:
        i, j = edges[k, 0], edges[k, 1]
        while leader[i] != i:
            leader[i] = leader[leader[i]]
            i = leader[i]
        while leader[j] != j:
            leader[j] = leader[leader[j]]
            j = leader[j]
        if i != j:
            leader[i] = j
            tree[k] = True
    return tree


@numba.njit(cache=True)
def depth_first_tree(n, edges, edge_order, root):
    """Return the spanning tree of a depth-first search from `root` in `edge_order`, bool (m,)."""
    first, target, edge = _arcs(n, edges, edge_order)
    following = first[:n].copy()
    seen = np.zeros(n, dtype=np.bool_)
    tree = np.zeros(len(edges), dtype=np.bool_)
    stack = np.empty(n, dtype=np.int64)
    stack[0], depth = root, 1
    seen[root] = True
    while depth > 0:
        v = stack[depth - 1]
        if following[v] == first[v + 1]:
            depth -= 1
            continue
        arc = following[v]
        following[v] += 1
        if not seen[target[arc]]:
            seen[target[arc]] = True
            tree[edge[arc]] = True
            stack[depth] = target[arc]
            depth += 1
    return tree


@numba.njit(cache=True)
def walk(types, edges, tree, edge_order, root, letters):
    """Return the tokens of a walk along `tree` from `root`: `(codes, nodes)`, both int64.

    codes: a type below `letters`, `letters` for `(`, `letters` + 1 for `)`, `letters` + 2 + k for cycle number k.
    nodes: the nodes in the order of their codes; fewer than there are if the graph is not connected.

    Children come in `edge_order`. After a node come the numbers that end there, ascending, then those that start there,
    in the order of their ends. A number that starts is the lowest that is free; numbers are free after the node where
    they end.
    """
    first, target, edge = _arcs(len(types), edges, edge_order)
    events, nodes = _tree_walk(first, target, edge, tree, root)
    return _written(types, events, nodes, first, target, edge, tree, letters), nodes


@numba.njit(cache=True)
def _tree_walk(first, target, edge, tree, root):
    """Return a walk along `tree`, with -1 and -2 for parentheses around all but the last subtrees, and its nodes."""
    n = len(first) - 1
    events = np.empty(3 * n, dtype=np.int64)
    nodes = np.empty(n, dtype=np.int64)
    seen = np.zeros(n, dtype=np.bool_)
    stack = np.empty(3 * n, dtype=np.int64)
    stack[0], size, written, reached = root, 1, 0, 0
    while size > 0:
        size -= 1
        event = stack[size]
        events[written] = event
        written += 1
        if event < 0:
            continue
        nodes[reached], seen[event] = event, True
        reached += 1
        is_last = True
        for arc in range(first[event + 1] - 1, first[event] - 1, -1):
            if not tree[edge[arc]] or seen[target[arc]]:
                continue
            if is_last:
                stack[size] = target[arc]
                size += 1
                is_last = False
            else:
                stack[size], stack[size + 1], stack[size + 2] = -2, target[arc], -1
                size += 3
    return events[:written], nodes[:reached]


@numba.njit(cache=True)
def _written(types, events, nodes, first, target, edge, tree, letters):
    """Return the codes of a walk: types, parentheses, and the numbers of the edges that are not in `tree`."""
    m = len(tree)
    rank = np.full(len(types), -1, dtype=np.int64)
    for k in range(len(nodes)):
        rank[nodes[k]] = k
    codes = np.empty(len(events) + 2 * m, dtype=np.int64)
    number = np.full(m, -1, dtype=np.int64)
    taken = np.zeros(m + 1, dtype=np.bool_)
    ending = np.empty(m, dtype=np.int64)
    partner = np.empty(m, dtype=np.int64)
    length = 0
    for event in events:
        if event < 0:
            codes[length] = letters - 1 - event
            length += 1
            continue
        codes[length] = types[event]
        length += 1
        ends, begins = 0, 0
        for arc in range(first[event], first[event + 1]):
            k = edge[arc]
            if tree[k]:
                continue
            if number[k] >= 0:
                ending[ends] = number[k]
                ends += 1
            else:
                partner[begins] = rank[target[arc]] * m + k
                begins += 1
        sort_values(ending[:ends])
        for code in ending[:ends]:
            codes[length] = letters + 2 + code
            length += 1
        sort_values(partner[:begins])
        lowest = 0
        for key in partner[:begins]:
            while taken[lowest]:
                lowest += 1
            taken[lowest] = True
            number[key % m] = lowest
            codes[length] = letters + 2 + lowest
            length += 1
        for code in ending[:ends]:
            taken[code] = False
    return codes[:length]
