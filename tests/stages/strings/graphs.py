"""Coloured graphs for the tests of strings, and networkx's word on whether two are the same."""

from __future__ import annotations

import networkx as nx
import numpy as np
from hypothesis import strategies as st

from stages.strings.tokens import Alphabet, make_alphabet

Graph = tuple[np.ndarray, np.ndarray]

ALPHABET: Alphabet = make_alphabet([f"part {index}" for index in range(6)])


def arrays(graph: nx.Graph, types: np.ndarray | None = None) -> Graph:
    """Types (all 0 unless given) and edges i < j of a networkx graph."""
    graph = nx.convert_node_labels_to_integers(graph)
    edges = np.array([sorted(edge) for edge in graph.edges()], dtype=np.int32).reshape(-1, 2)
    return (np.zeros(len(graph), dtype=np.int16) if types is None else types.astype(np.int16)), edges


def renamed(graph: Graph, rng: np.random.Generator) -> Graph:
    """The same graph with its nodes renamed and its edges in another order and direction."""
    types, edges = graph
    old = rng.permutation(len(types))
    ends = np.argsort(old)[edges].astype(np.int32)
    turned = rng.random(len(edges)) < 0.5
    ends[turned] = ends[turned][:, ::-1]
    return types[old], ends[rng.permutation(len(edges))]


def isomorphic(first: Graph, second: Graph) -> bool:
    """Whether networkx finds an isomorphism that keeps the types."""
    graphs = []
    for types, edges in (first, second):
        graph = nx.Graph()
        graph.add_nodes_from((index, {"type": int(part_type)}) for index, part_type in enumerate(types))
        graph.add_edges_from(edges.tolist())
        graphs.append(graph)
    return bool(nx.is_isomorphic(*graphs, node_match=lambda a, b: a["type"] == b["type"]))


@st.composite
def connected_graphs(draw: st.DrawFn, nodes: int = 60) -> Graph:
    """Connected graphs of many kinds: trees, rings, cliques, grids, sparse and dense random ones."""
    kind = draw(st.sampled_from(["tree", "ring", "clique", "grid", "sparse", "dense", "star"]))
    seed = draw(st.integers(0, 2**32 - 1))
    n = draw(st.integers(1, nodes))
    rng = np.random.default_rng(seed)
    if kind == "ring":
        graph = nx.cycle_graph(max(n, 3))
    elif kind == "clique":
        graph = nx.complete_graph(min(n, 30))
    elif kind == "grid":
        graph = nx.grid_2d_graph(max(1, n // 8), min(n, 8))
    elif kind == "star":
        graph = nx.star_graph(n - 1)
    else:
        graph = nx.random_labeled_tree(n, seed=seed)
        extra = {"tree": 0, "sparse": 4, "dense": 4 * n}[kind]
        graph.add_edges_from((i, j) for i, j in rng.integers(0, n, (extra, 2)).tolist() if i != j)
    return arrays(graph, rng.integers(0, draw(st.integers(1, 6)), len(graph)))
