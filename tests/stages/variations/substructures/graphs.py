"""Small ordered typed graphs: paths, rings, grids, trees, and such with random orders."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stages.variations.substructures.ordered_graph import OrderedGraph, ordered_graph

Rows = list[tuple[int, ...]]


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
    return ordered_graph(rng.integers(types, size=n), [rng.permutation(neighbour).tolist() for neighbour in near])


def patterned_graph(rng: np.random.Generator, most: int) -> OrderedGraph:
    """A random graph whose types follow a pattern, by which pieces of it are alike: the number of docking sites, or the
    distance from one node modulo two or three."""
    graph = random_graph(rng, most)
    node = int(rng.integers(len(graph.types)))
    distances, waiting = {node: 0}, [node]
    for entry in waiting:
        fresh = [other for other in graph.neighbours(entry) if other not in distances]
        distances |= dict.fromkeys(fresh, distances[entry] + 1)
        waiting += fresh
    by_distance = np.array([distances[part_type] for part_type in range(len(graph.types))])
    types = (np.diff(graph.starts), by_distance % 2, by_distance % 3)[int(rng.integers(3))]
    return graph._replace(types=types.astype(np.int64))


def crop(rng: np.random.Generator, graph: OrderedGraph, most: int) -> OrderedGraph:
    """A connected piece of a graph, of 3 to `most` nodes."""
    size = int(rng.integers(3, most + 1))
    chosen = [int(rng.integers(len(graph.types)))]
    while len(chosen) < size:
        rim = sorted({other for node in chosen for other in graph.neighbours(node)} - set(chosen))
        if not rim:
            break
        chosen.append(rim[int(rng.integers(len(rim)))])
    place = {node: at for at, node in enumerate(sorted(chosen))}
    orders = [[place[other] for other in graph.neighbours(node) if other in place] for node in place]
    return ordered_graph(graph.types[list(place)], orders)


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
    kinds = list(zip(graph.types.tolist(), np.diff(graph.starts).tolist(), strict=True))
    rarest = min(kinds, key=lambda kind: (kinds.count(kind), kind))
    types, starts, tails, twins = (entry.tolist() for entry in graph[:4])
    best: Rows = []
    for dart, node in enumerate(tails):
        if kinds[node] == rarest:
            best = _smaller_rows(types, starts, tails, twins, dart, best)
    return tuple(best)


def _smaller_rows(
    types: list[int], starts: list[int], tails: list[int], twins: list[int], dart: int, best: Rows
) -> Rows:
    """Return the rows of nodes in the order of a walk from a dart, or the best ones so far where these are smaller."""
    first, place = {tails[dart]: dart}, {tails[dart]: 0}
    order, rows, equal = [tails[dart]], [], bool(best)
    for node in order:
        begin = first[node]
        row = [types[node]]
        for number in (*range(begin, starts[node + 1]), *range(starts[node], begin)):
            back = twins[number]
            head = tails[back]
            if head not in first:
                first[head], place[head] = back, len(order)
                order.append(head)
            row.append(place[head])
        rows.append(tuple(row))
        if equal and rows[-1] != best[len(rows) - 1]:
            if rows[-1] > best[len(rows) - 1]:
                return best
            equal = False
    return rows
