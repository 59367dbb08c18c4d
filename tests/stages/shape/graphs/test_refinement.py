"""The equitable partition against its definition: the colour, and the colours around, until nothing changes."""

from __future__ import annotations

from collections import Counter

import networkx as nx
import numpy as np
import pytest

from stages.shape.graphs.refinement import refine


def coarsest(colors: list[int], arcs: list[list[tuple[int, int]]]) -> set[frozenset[int]]:
    """The classes of colour refinement by its definition; `arcs` lists (neighbour, class) for each node."""
    current = list(colors)
    while True:
        seen = [(current[v], tuple(sorted((c, current[u]) for u, c in arcs[v]))) for v in range(len(current))]
        names = {signature: index for index, signature in enumerate(sorted(set(seen)))}
        following = [names[signature] for signature in seen]
        if len(set(following)) == len(set(current)):
            return {frozenset(v for v, c in enumerate(following) if c == name) for name in set(following)}
        current = following


@pytest.mark.parametrize("classes", [1, 3])
@pytest.mark.parametrize("seed", range(40))
def test_cells_are_those_of_the_definition_in_the_same_order_for_every_renaming(seed: int, classes: int) -> None:
    rng = np.random.default_rng([seed, classes])
    n = int(rng.integers(2, 40))
    graph = [
        nx.gnm_random_graph(n, int(rng.integers(0, 2 * n)), seed=seed),
        nx.convert_node_labels_to_integers(nx.grid_2d_graph(3, n)),
        nx.random_labeled_tree(n, seed=seed),
    ][seed % 3]
    n = len(graph)
    colors = rng.integers(0, 2, n)
    edges = np.array(list(graph.edges()), dtype=np.int64).reshape(-1, 2)
    forward, backward = rng.integers(0, classes, (2, len(edges)))
    arcs: list[list[tuple[int, int]]] = [[] for _ in range(n)]
    for (i, j), there, back in zip(edges.tolist(), forward.tolist(), backward.tolist(), strict=True):
        arcs[i].append((j, there))
        arcs[j].append((i, back))

    def cells(order: np.ndarray, start: np.ndarray) -> list[frozenset[int]]:
        return [frozenset(order[start == k].tolist()) for k in np.unique(start)]

    found = cells(*refine(colors, edges, forward, backward, classes))
    assert set(found) == coarsest(colors.tolist(), arcs)
    assert Counter(v for cell in found for v in cell) == Counter(range(n))

    old = rng.permutation(n)
    again = cells(*refine(colors[old], np.argsort(old)[edges], forward, backward, classes))
    assert [frozenset(old[list(cell)].tolist()) for cell in again] == found
