"""Strings and canonical graphs per second, compared with networkx on the same graph.

networkx has no SMILES of arbitrary graphs; the peer is its text format sparse6, which has no types and keeps the order
of the nodes. Its Weisfeiler-Lehman hash is not exact, ours is.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from stages.shape.graphs.canonical import docking_digest, graph_digest
from stages.strings.decoder import decode
from stages.strings.encoder import canonical_string, encode
from stages.strings.tokens import make_alphabet
from tests.bench.measure import Measure, rate

TYPE_COUNT, GRAPHS_PER_CALL = 13, 20


def tower(diagonals: int = 183) -> tuple[np.ndarray, np.ndarray]:
    """Return types and edges of 4 x 4 x 6 boxes: 224 contacts at faces, and some at edges, as in a castle."""
    rng = np.random.default_rng(0)
    cells = np.argwhere(np.ones((4, 4, 6), dtype=bool))
    gaps = np.triu(np.abs(cells[:, None] - cells[None]).sum(axis=2))
    steps = np.triu(np.abs(cells[:, None] - cells[None]).max(axis=2))
    at_faces, at_edges = np.argwhere(gaps == 1), np.argwhere((gaps == 2) & (steps == 1))
    edges = np.concatenate([at_faces, rng.permutation(at_edges)[:diagonals]])
    return rng.integers(0, TYPE_COUNT, len(cells)).astype(np.int16), edges.astype(np.int32)


def bench() -> Iterator[Measure]:
    """Graphs per second and core."""
    import networkx as nx

    types, edges = tower()
    alphabet = make_alphabet([f"type {index}" for index in range(TYPE_COUNT)])
    rng = np.random.default_rng(0)
    graph = nx.Graph(edges.tolist())
    nx.set_node_attributes(graph, dict(enumerate(types.tolist())), "type")
    text = nx.to_sparse6_bytes(graph).strip()
    strings = [encode(types, edges, alphabet, rng).string for _ in range(GRAPHS_PER_CALL)]
    labels = np.stack([edges.sum(axis=1) % 28, edges.sum(axis=1) % 28], axis=1).astype(np.int32)
    size = f"{len(types)} nodes, {len(edges)} edges"

    def random_walks() -> int:
        return len([encode(types, edges, alphabet, rng) for _ in range(GRAPHS_PER_CALL)])

    def canonical_walks() -> int:
        return len([canonical_string(types, edges, alphabet) for _ in range(GRAPHS_PER_CALL)])

    def decoding() -> int:
        return len([decode(string, alphabet) for string in strings])

    def sparse6_writing() -> int:
        return len([nx.to_sparse6_bytes(graph) for _ in range(GRAPHS_PER_CALL)])

    def sparse6_reading() -> int:
        return len([nx.from_sparse6_bytes(text) for _ in range(GRAPHS_PER_CALL)])

    def digests() -> int:
        return len([graph_digest(types, edges) for _ in range(GRAPHS_PER_CALL)])

    def docking_digests() -> int:
        return len([docking_digest(types, edges, labels) for _ in range(GRAPHS_PER_CALL)])

    def hashes() -> int:
        return len([nx.weisfeiler_lehman_graph_hash(graph, node_attr="type") for _ in range(GRAPHS_PER_CALL)])

    writing, reading, hashing = (rate(work, 0.5) for work in (sparse6_writing, sparse6_reading, hashes))
    yield Measure(f"random strings, {size}", "strings", rate(random_walks, 0.5), "networkx sparse6", writing)
    yield Measure(f"canonical strings, {size}", "strings", rate(canonical_walks, 0.5), "networkx sparse6", writing)
    yield Measure(f"strings decoded, {size}", "strings", rate(decoding, 0.5), "networkx sparse6", reading)
    note = "the peer is not exact"
    yield Measure(f"graph digests, {size}", "graphs", rate(digests, 0.5), "networkx WL hash", hashing, note)
    yield Measure(f"docking digests, {size}", "graphs", rate(docking_digests, 0.5), "networkx WL hash", hashing, note)
