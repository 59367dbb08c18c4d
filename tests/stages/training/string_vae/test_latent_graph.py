"""Graphs over latent points and their shortest paths, on cases small enough to see."""

from __future__ import annotations

import networkx as nx
import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from stages.training.string_vae.latent_graph import (
    interpolation,
    naive_graph,
    nearest_points,
    nearest_strings,
    path_figures,
    search_graph,
)


def test_strings_of_one_graph_are_joined_at_no_cost() -> None:
    line = np.arange(12, dtype=np.float32)[:, None] ** 2
    graphs = [str(number) for number in range(11)] + ["0"]
    histograms = np.stack([np.arange(12) + 1, np.full(12, 5)], axis=1)
    histograms[11] = histograms[0]
    graph = search_graph(line, graphs, histograms)
    assert interpolation(graph, 0, 11) == [0, 11]
    assert path_figures(graph).components == 1


def test_interpolation_is_a_shortest_path_by_histogram_distance() -> None:
    # Neighbours in latent space are a chain; the histograms grow along it.
    points = np.arange(9, dtype=np.float32)[:, None]
    histograms = np.stack([np.arange(1, 10), np.full(9, 3)], axis=1)
    path = interpolation(search_graph(points, list("abcdefghi"), histograms), 0, 8)
    assert path[0] == 0
    assert path[-1] == 8
    assert path == sorted(path)
    apart = np.concatenate([points[:5], points[:5] + 100])
    graph = search_graph(apart, list("abcdefghij"), np.ones((10, 2), np.int64))
    assert interpolation(graph, 0, 9) == []
    assert path_figures(graph).components == 2


@given(st.integers(0, 2**32), st.integers(2, 25))
def test_path_figures_cover_all_shortest_paths(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    graph_of = rng.integers(0, count, count)
    histograms = rng.integers(1, 6, (count, 3))[graph_of]  # equal graphs have equal parts
    graphs = [str(item) for item in graph_of]
    points = rng.standard_normal((count, 2)).astype(np.float32)
    graph = search_graph(points, graphs, histograms)
    oracle = nx.Graph()
    oracle.add_nodes_from(range(count))
    links = [*nearest_points(points, 4).tolist()]
    links += [(i, j) for i in range(count) for j in range(i) if graphs[i] == graphs[j]]
    for i, j in links:
        unlike = np.abs(histograms[i] - histograms[j]).sum() / (histograms[i] + histograms[j]).sum()
        oracle.add_edge(i, j, weight=unlike)
    lengths = dict(nx.all_pairs_dijkstra_path_length(oracle))
    found = path_figures(graph)
    assert found.components == nx.number_connected_components(oracle)
    paths = [lengths[i][j] for i in lengths for j in lengths[i] if i != j]
    np.testing.assert_allclose(found.mean, np.mean(paths))
    np.testing.assert_allclose(found.greatest, np.max(paths))


def edits(one: list[int], other: list[int]) -> int:
    if not one or not other:
        return len(one) + len(other)
    kept = edits(one[1:], other[1:]) + (one[0] != other[0])
    return min(kept, edits(one[1:], other) + 1, edits(one, other[1:]) + 1)


@given(st.lists(st.lists(st.integers(1, 3), min_size=1, max_size=5), min_size=3, max_size=6))
def test_nearest_strings_have_the_least_edit_distance(strings: list[list[int]]) -> None:
    links = nearest_strings([np.array(string, np.int16) for string in strings], 2)
    for node in range(len(strings)):
        chosen = [other for one, other in links.tolist() if one == node]
        assert len(set(chosen)) == 2
        assert node not in chosen
        distances = sorted(edits(strings[node], strings[other]) for other in range(len(strings)) if other != node)
        assert sorted(edits(strings[node], strings[other]) for other in chosen) == distances[:2]


def test_naive_graph_joins_similar_strings() -> None:
    codes = [
        np.array(value, np.int16)
        for value in ([1, 2], [1, 2, 3], [1, 1, 2], [2, 1, 2], [7] * 9, [7] * 10, [7] * 11, [7] * 12)
    ]
    graph = naive_graph(codes, list("abcdefgh"), np.ones((8, 2), np.int64))
    assert path_figures(graph).components == 2
