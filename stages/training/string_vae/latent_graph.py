"""A graph of strings in latent space; interpolations are shortest paths (strings §5.3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numba
import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components, dijkstra

from stages.shape.graphs.histograms import histogram_metric
from stages.shapeassembly.analysis.edit_distance import edit_distance

POINT_NEIGHBOURS = 4
"""Neighbours of a node besides strings of the same graph: "between 3 and 5" (strings §5.3)."""
STRING_NEIGHBOURS = 3
"""The same in the naive graph (strings Table 2)."""

Links = npt.NDArray[np.int64]
"""Pairs of nodes, int64 (m, 2)."""
Histograms = npt.NDArray[np.int64]
"""Parts of each type of each shape, int64 (n, types)."""
Codes = npt.NDArray[np.int16]


@dataclass(frozen=True)
class PathFigures:
    """Figures of all shortest paths of a graph (strings Table 2).

    components: connected components.
    mean, greatest: weight of the paths between connected nodes.
    """

    components: int
    mean: float
    greatest: float


def search_graph(points: npt.NDArray[np.float32], graphs: Sequence[str], histograms: Histograms) -> csr_matrix:
    """Return the search graph: strings are joined to the nearest in latent space, and to those of the same graph.

    points: float32 (n, latent).
    graphs: an identifier of each string's graph.
    histograms: int64 (n, types).
    Weights are E, 0 between strings of one graph: float64 (n, n), symmetric, stored zeros are edges.
    """
    return _weighted(nearest_points(points, POINT_NEIGHBOURS), graphs, histograms)


def naive_graph(codes: Sequence[Codes], graphs: Sequence[str], histograms: Histograms) -> csr_matrix:
    """Return the same graph with the nearest strings by edit distance (strings Table 2)."""
    return _weighted(nearest_strings(codes, STRING_NEIGHBOURS), graphs, histograms)


def path_figures(graph: csr_matrix) -> PathFigures:
    """Return the figures of Table 2 of a graph with at least one node."""
    components, _ = connected_components(graph, directed=False)
    lengths = dijkstra(graph, directed=False)
    paths = lengths[np.isfinite(lengths) & ~np.eye(len(lengths), dtype=np.bool_)]
    return PathFigures(int(components), float(paths.mean()) if len(paths) else 0.0, float(paths.max(initial=0.0)))


def interpolation(graph: csr_matrix, first: int, second: int) -> list[int]:
    """Return the nodes of a shortest path with both ends, or an empty list."""
    lengths, before = dijkstra(graph, directed=False, indices=first, return_predecessors=True)
    if not np.isfinite(lengths[second]):
        return []
    path = [second]
    while path[-1] != first:
        path.append(int(before[path[-1]]))
    return path[::-1]


def nearest_points(points: npt.NDArray[np.float32], count: int) -> Links:
    """Link each point to the `count` nearest others."""
    from scipy.spatial import cKDTree

    count = min(count, len(points) - 1)
    _, near = cKDTree(points.astype(np.float64)).query(points, k=count + 1)
    near = near.reshape(len(points), -1)
    others = [[other for other in row if other != node][:count] for node, row in enumerate(near.tolist())]
    return np.array([(node, other) for node, row in enumerate(others) for other in row], np.int64).reshape(-1, 2)


def nearest_strings(codes: Sequence[Codes], count: int) -> Links:
    """Link each string to the `count` nearest others by edit distance of their tokens, the first ones at equal
    distance."""
    first = np.concatenate([[0], np.cumsum([len(string) for string in codes])]).astype(np.int64)
    distances = _edit_distances(np.concatenate(codes), first)
    np.fill_diagonal(distances, np.iinfo(np.int32).max)
    near = np.argsort(distances, axis=1, kind="stable")[:, : min(count, len(codes) - 1)]
    return np.stack([np.repeat(np.arange(len(codes)), near.shape[1]), near.ravel()], axis=1).astype(np.int64)


def _weighted(links: Links, graphs: Sequence[str], histograms: Histograms) -> csr_matrix:
    """Weight the links, and chains of strings of one graph, which replace all their pairs."""
    equals: dict[str, list[int]] = {}
    for node, graph in enumerate(graphs):
        equals.setdefault(graph, []).append(node)
    chains = [pair for nodes in equals.values() for pair in pairwise(nodes)]
    joined = np.concatenate([links, np.array(chains, np.int64).reshape(-1, 2)])
    joined = np.unique(np.sort(joined, axis=1), axis=0)  # duplicates would add up
    weights = histogram_metric(histograms[joined[:, 0]], histograms[joined[:, 1]])
    both = np.concatenate([joined, joined[:, ::-1]])
    return csr_matrix((np.tile(weights, 2), (both[:, 0], both[:, 1])), shape=(len(graphs), len(graphs)))


@numba.njit(cache=True)
def _edit_distances(codes, first):
    """Return the edit distances of all pairs of strings, int32 (n, n); string i is `codes[first[i]:first[i + 1]]`."""
    n = len(first) - 1
    distances = np.zeros((n, n), np.int32)
    for i in range(n):
        for j in range(i):
            distance = edit_distance(codes[first[i] : first[i + 1]], codes[first[j] : first[j + 1]])
            distances[i, j] = distances[j, i] = distance
    return distances
