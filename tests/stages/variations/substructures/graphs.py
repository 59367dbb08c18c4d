"""Small ordered typed graphs: paths, rings, grids, trees, and such with random orders."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stages.variations.substructures.ordered import OrderedGraph, ordered_graph


def path(*types: int) -> OrderedGraph:
    last = len(types) - 1
    return ordered_graph(types, [[near for near in (at - 1, at + 1) if 0 <= near <= last] for at in range(len(types))])


def ring(*types: int) -> OrderedGraph:
    n = len(types)
    return ordered_graph(types, [[(at - 1) % n, (at + 1) % n] for at in range(n)])


def grid(width: int, depth: int, types: Sequence[int] | None = None) -> OrderedGraph:
    """Cells, whose neighbours go round counter-clockwise."""
    orders = []
    for at in range(width * depth):
        x, y = at % width, at // width
        steps = ((x + 1, y), (x, y + 1), (x - 1, y), (x, y - 1))
        orders.append([v * width + u for u, v in steps if 0 <= u < width and 0 <= v < depth])
    return ordered_graph(types or [0] * len(orders), orders)


def random_graph(rng: np.random.Generator, most: int) -> OrderedGraph:
    """A grid, a ring, a tree or a connected graph of any kind with at most `most` nodes of one to three types."""
    kind, types = int(rng.integers(4)), int(rng.integers(1, 4))
    n = int(rng.integers(3, most + 1))
    if kind == 0:
        depth = 2 if n < 9 else int(rng.integers(2, 4))
        width = n // depth
        return grid(max(width, 2), depth, rng.integers(types, size=max(width, 2) * depth).tolist())
    if kind == 1:
        return ring(*rng.integers(types, size=n).tolist())
    near: list[list[int]] = [[] for _ in range(n)]
    for node in range(1, n):
        other = int(rng.integers(node))
        near[node].append(other)
        near[other].append(node)
    for _ in range(int(rng.integers(n)) if kind == 3 else 0):
        i, j = rng.choice(n, 2, replace=False).tolist()
        if j not in near[i]:
            near[i].append(j)
            near[j].append(i)
    return ordered_graph(rng.integers(types, size=n), [rng.permutation(each).tolist() for each in near])


def is_connected(graph: OrderedGraph) -> bool:
    seen, waiting = set(), [0]
    while waiting:
        node = waiting.pop()
        if node not in seen:
            seen.add(node)
            waiting += graph.neighbours(node)
    return len(seen) == len(graph.types)


def code(graph: OrderedGraph) -> tuple[tuple[int, ...], ...]:
    """The same for two connected ordered graphs exactly if one is the other with its nodes named otherwise."""
    if len(graph.types) == 1:
        return ((int(graph.types[0]),),)
    return min(_code_from(graph, dart) for dart in range(len(graph.tails)))


def _code_from(graph: OrderedGraph, dart: int) -> tuple[tuple[int, ...], ...]:
    first = {int(graph.tails[dart]): dart}
    order, rows = [int(graph.tails[dart])], []
    for node in order:
        start, end = int(graph.starts[node]), int(graph.starts[node + 1])
        around = [start + (first[node] - start + step) % (end - start) for step in range(end - start)]
        for back in (int(graph.twins[each]) for each in around):
            if int(graph.tails[back]) not in first:
                first[int(graph.tails[back])] = back
                order.append(int(graph.tails[back]))
        heads = [order.index(int(graph.tails[graph.twins[each]])) for each in around]
        rows.append((int(graph.types[node]), *heads))
    return tuple(rows)
