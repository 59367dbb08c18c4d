"""Canonical graphs against networkx's isomorphism search, on graphs that are easy, symmetric and hard to tell apart."""

from __future__ import annotations

import itertools
import random
from typing import Any

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stages.shape.graphs.canonical import canonical_order, docking_digest, graph_digest

FAMILIES = {
    "ring": nx.cycle_graph(12),
    "two rings": nx.disjoint_union(nx.cycle_graph(6), nx.cycle_graph(6)),
    "grid": nx.convert_node_labels_to_integers(nx.grid_2d_graph(4, 5)),
    "box": nx.convert_node_labels_to_integers(nx.grid_graph((3, 3, 3))),
    "torus": nx.convert_node_labels_to_integers(nx.grid_2d_graph(4, 4, periodic=True)),
    "clique": nx.complete_graph(7),
    "petersen": nx.petersen_graph(),
    "tree": nx.balanced_tree(2, 4),
    "star": nx.star_graph(9),
    "bipartite": nx.complete_bipartite_graph(4, 5),
    "points": nx.empty_graph(5),
}


def arrays(graph: nx.Graph, types: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    edges = np.array(list(graph.edges()), dtype=np.int32).reshape(-1, 2)
    return np.zeros(len(graph), dtype=np.int16) if types is None else types, edges


def renamed(types: np.ndarray, edges: np.ndarray, rng: np.random.Generator, *labels: np.ndarray) -> Any:
    """The same graph with its nodes renamed, its edges in another order, some of them turned round; labels if given."""
    old = rng.permutation(len(types))
    new = np.argsort(old)
    turned = rng.random(len(edges)) < 0.5
    rows = rng.permutation(len(edges))
    ends = new[edges].astype(np.int32)
    ends[turned] = ends[turned][:, ::-1]
    if not labels:
        return types[old], ends[rows]
    seen = labels[0].copy()
    seen[turned] = seen[turned][:, ::-1]
    return types[old], ends[rows], seen[rows]


def isomorphic(
    first: tuple[np.ndarray, np.ndarray],
    second: tuple[np.ndarray, np.ndarray],
    labels: tuple[np.ndarray, np.ndarray] | None = None,
) -> bool:
    graphs = []
    for index, (types, edges) in enumerate((first, second)):
        graph = nx.DiGraph()
        graph.add_nodes_from((i, {"type": int(kind)}) for i, kind in enumerate(types))
        seen = np.zeros_like(edges) if labels is None else labels[index]
        for (i, j), (a, b) in zip(edges.tolist(), seen.tolist(), strict=True):
            graph.add_edge(i, j, label=a)
            graph.add_edge(j, i, label=b)
        graphs.append(graph)
    same = nx.is_isomorphic(
        *graphs,
        node_match=lambda a, b: a["type"] == b["type"],
        edge_match=lambda a, b: a["label"] == b["label"],
    )
    return bool(same)


@st.composite
def small_graphs(draw: st.DrawFn, nodes: int = 7, colors: int = 2) -> tuple[np.ndarray, np.ndarray]:
    n = draw(st.integers(1, nodes))
    pairs = list(itertools.combinations(range(n), 2))
    chosen = draw(st.lists(st.sampled_from(pairs), unique=True)) if pairs else []
    types = draw(st.lists(st.integers(0, colors - 1), min_size=n, max_size=n))
    return np.array(types, dtype=np.int16), np.array(chosen, dtype=np.int32).reshape(-1, 2)


@pytest.mark.parametrize("name", FAMILIES)
def test_renaming_the_nodes_changes_no_digest(name: str) -> None:
    rng = np.random.default_rng(1)
    types, edges = arrays(FAMILIES[name])
    assert {graph_digest(*renamed(types, edges, rng)) for _ in range(20)} == {graph_digest(types, edges)}


@pytest.mark.parametrize("name", FAMILIES)
def test_graphs_put_in_canonical_order_are_equal(name: str) -> None:
    rng = np.random.default_rng(2)
    types, edges = arrays(FAMILIES[name], rng.integers(0, 2, len(FAMILIES[name])).astype(np.int16))

    def canonical(types: np.ndarray, edges: np.ndarray) -> tuple[list[int], set[frozenset[int]]]:
        order = canonical_order(types, edges)
        assert sorted(order.tolist()) == list(range(len(types)))
        place = np.argsort(order)
        return types[order].tolist(), {frozenset(edge) for edge in place[edges].tolist()}

    expected = canonical(types, edges)
    assert all(canonical(*renamed(types, edges, rng)) == expected for _ in range(10))


def test_every_graph_of_six_nodes_has_its_own_digest() -> None:
    atlas = [graph for graph in nx.graph_atlas_g() if len(graph) == 6]
    assert len(atlas) == 156  # the number of graphs on six nodes up to isomorphism
    assert len({graph_digest(*arrays(graph)) for graph in atlas}) == 156


def test_strongly_regular_graphs_with_equal_parameters_differ() -> None:
    """Shrikhande's graph and the 4 by 4 rook's graph: both (16, 6, 2, 2), so no counting of neighbours parts them."""
    rook = nx.line_graph(nx.complete_bipartite_graph(4, 4))
    shrikhande = nx.Graph()
    for x, y in itertools.product(range(4), repeat=2):
        for dx, dy in ((0, 1), (1, 0), (1, 1)):
            shrikhande.add_edge((x, y), ((x + dx) % 4, (y + dy) % 4))
    digests = set()
    for graph in (rook, shrikhande):
        types, edges = arrays(nx.convert_node_labels_to_integers(graph))
        rng = np.random.default_rng(3)
        assert {graph_digest(*renamed(types, edges, rng)) for _ in range(10)} == {graph_digest(types, edges)}
        digests.add(graph_digest(types, edges))
    assert len(digests) == 2


def test_regular_graphs_have_equal_digests_exactly_when_isomorphic() -> None:
    graphs = [arrays(nx.random_regular_graph(3, 8, seed=seed)) for seed in range(30)]
    digests = [graph_digest(*graph) for graph in graphs]
    assert 1 < len(set(digests)) < 30
    for (a, first), (b, second) in itertools.combinations(zip(digests, graphs, strict=True), 2):
        assert (a == b) == isomorphic(first, second)


def test_one_long_ring_is_not_two_short_ones() -> None:
    assert graph_digest(*arrays(FAMILIES["ring"])) != graph_digest(*arrays(FAMILIES["two rings"]))


@settings(max_examples=200, deadline=None)
@given(small_graphs(), small_graphs(), st.integers(0, 2**32 - 1))
def test_digests_are_equal_exactly_for_isomorphic_graphs(
    first: tuple[np.ndarray, np.ndarray], second: tuple[np.ndarray, np.ndarray], seed: int
) -> None:
    rng = np.random.default_rng(seed)
    assert graph_digest(*renamed(*first, rng)) == graph_digest(*first)
    assert (graph_digest(*first) == graph_digest(*second)) == isomorphic(first, second)


@settings(max_examples=200, deadline=None)
@given(small_graphs(6), st.integers(0, 2**32 - 1))
def test_one_changed_edge_or_type_is_seen_exactly_when_it_matters(
    graph: tuple[np.ndarray, np.ndarray], seed: int
) -> None:
    """Neighbours of one graph in the space of graphs: nearly alike, sometimes alike."""
    rng = np.random.default_rng(seed)
    types, edges = graph
    changed = types.copy()
    changed[rng.integers(len(types))] ^= 1
    near = [(changed, edges)]
    if len(edges):
        dropped = np.delete(edges, rng.integers(len(edges)), axis=0)
        near.append((types, dropped))
        near.append((types, np.delete(edges, rng.integers(len(edges)), axis=0)))
    for one, other in itertools.combinations([graph, *near], 2):
        other = renamed(*other, rng)
        assert (graph_digest(*one) == graph_digest(*other)) == isomorphic(one, other)


@settings(max_examples=200, deadline=None)
@given(small_graphs(6), st.integers(0, 2**32 - 1), st.integers(1, 4))
def test_docking_digests_are_equal_exactly_for_graphs_with_the_same_labels(
    graph: tuple[np.ndarray, np.ndarray], seed: int, kinds: int
) -> None:
    rng = np.random.default_rng(seed)
    types, edges = graph
    labels = rng.integers(-1, kinds, (len(edges), 2)).astype(np.int32)
    assert docking_digest(*renamed(types, edges, rng, labels)) == docking_digest(types, edges, labels)
    others = [rng.integers(-1, kinds, (len(edges), 2)).astype(np.int32), rng.permutation(labels), labels[:, ::-1]]
    for other in others:
        same = isomorphic(graph, graph, (labels, other))
        assert (docking_digest(types, edges, labels) == docking_digest(types, edges, other)) == same


@pytest.mark.parametrize("name", ["ring", "grid", "torus", "clique", "tree", "bipartite", "petersen"])
@pytest.mark.parametrize("labelling", ["uniform", "oriented", "one odd", "random"])
def test_renaming_the_nodes_changes_no_docking_digest(name: str, labelling: str) -> None:
    rng = np.random.default_rng(4)
    types, edges = arrays(FAMILIES[name])
    labels = np.zeros((len(edges), 2), dtype=np.int32)
    if labelling == "oriented":
        labels[:, 1] = 1
    elif labelling == "one odd":
        labels[0] = 5
    elif labelling == "random":
        labels = rng.integers(0, 2, labels.shape).astype(np.int32)
    expected = docking_digest(types, edges, labels)
    assert {docking_digest(*renamed(types, edges, rng, labels)) for _ in range(10)} == {expected}


def test_a_ring_that_runs_one_way_differs_from_one_that_turns() -> None:
    """Every node alike, every label alike: only the direction of single edges tells."""
    types, edges = arrays(nx.cycle_graph(6))
    edges = np.array([[i, (i + 1) % 6] for i in range(6)], dtype=np.int32)
    one_way = np.tile(np.array([0, 1], dtype=np.int32), (6, 1))
    turning = one_way.copy()
    turning[::2] = turning[::2, ::-1]
    twice = one_way.copy()
    twice[3:] = twice[3:, ::-1]
    digests = [docking_digest(types, edges, labels) for labels in (one_way, turning, twice)]
    assert len(set(digests)) == 3
    assert docking_digest(types, edges, one_way[:, ::-1]) == digests[0]


def test_canonical_order_draws_no_random_number() -> None:
    """igraph draws from Python's own generator, where it draws."""
    types, edges = arrays(FAMILIES["torus"])
    orders = []
    for seed in (1, 2):
        random.seed(seed)
        before = random.getstate()
        orders.append(canonical_order(types, edges).tolist())
        assert random.getstate() == before
    assert orders[0] == orders[1]


def test_labels_are_compared_by_value() -> None:
    types, edges = arrays(nx.path_graph(2))
    same, other = (np.array([[label, label]], dtype=np.int32) for label in (3, 4))
    assert docking_digest(types, edges, same) != docking_digest(types, edges, other)


def test_types_are_compared_by_value() -> None:
    _, edges = arrays(nx.path_graph(2))
    assert graph_digest(np.array([0, 1], dtype=np.int16), edges) != graph_digest(np.array([0, 2], np.int16), edges)


def test_lower_types_come_first_in_canonical_order() -> None:
    types = np.array([2, 0, 1, 0], dtype=np.int16)
    order = canonical_order(types, np.array([[0, 1], [1, 2], [2, 3]], dtype=np.int32))
    assert types[order].tolist() == [0, 0, 1, 2]


def test_graphs_of_no_node_and_of_one_have_digests() -> None:
    none = np.empty((0, 2), dtype=np.int32)
    digests = {graph_digest(np.zeros(n, dtype=np.int16), none) for n in range(3)}
    assert len(digests) == 3


@pytest.mark.parametrize("edges", [[[0, 0]], [[0, 1], [1, 0]], [[0, 1], [0, 1]], [[0, 3]], [[-1, 0]]])
def test_edges_that_make_no_simple_graph_are_refused(edges: list[list[int]]) -> None:
    with pytest.raises(ValueError, match=r"simple|not there"):
        graph_digest(np.zeros(3, dtype=np.int16), np.array(edges, dtype=np.int32))


def test_labels_that_do_not_fit_the_edges_are_refused() -> None:
    types, edges = arrays(nx.path_graph(3))
    with pytest.raises(ValueError, match="1 rows of labels for 2 edges"):
        docking_digest(types, edges, np.zeros((1, 2), dtype=np.int32))
