"""Strings and canonical graphs a second, beside networkx on the same graph.

networkx has no SMILES of arbitrary graphs; its sparse6 is the text format of graphs that it writes and reads (without
types, and always in the order of the nodes). Its Weisfeiler-Lehman hash is not exact, ours is.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from stages.shape.graphs.canonical import docking_digest, graph_digest
from stages.strings.alphabet import make_alphabet
from stages.strings.decoder import decode
from stages.strings.encoder import canonical_string, encode
from tests.bench.measure import Measure, rate

TYPES, BATCH = 13, 20


def tower(diagonals: int = 183) -> tuple[np.ndarray, np.ndarray]:
    """A block of 4 x 4 x 6 boxes: 224 contacts at faces, and some at edges, as many as a castle of the kind has."""
    rng = np.random.default_rng(0)
    cells = np.argwhere(np.ones((4, 4, 6), dtype=bool))
    gaps = np.triu(np.abs(cells[:, None] - cells[None]).sum(axis=2))
    steps = np.triu(np.abs(cells[:, None] - cells[None]).max(axis=2))
    at_faces, at_edges = np.argwhere(gaps == 1), np.argwhere((gaps == 2) & (steps == 1))
    edges = np.concatenate([at_faces, rng.permutation(at_edges)[:diagonals]])
    return rng.integers(0, TYPES, len(cells)).astype(np.int16), edges.astype(np.int32)


def bench() -> Iterator[Measure]:
    """Graphs a second and core."""
    import networkx as nx

    types, edges = tower()
    alphabet = make_alphabet([f"type {index}" for index in range(TYPES)])
    rng = np.random.default_rng(0)
    graph = nx.Graph(edges.tolist())
    nx.set_node_attributes(graph, dict(enumerate(types.tolist())), "type")
    text = nx.to_sparse6_bytes(graph).strip()
    strings = [encode(types, edges, alphabet, rng).string for _ in range(BATCH)]
    labels = np.stack([edges.sum(axis=1) % 28, edges.sum(axis=1) % 28], axis=1).astype(np.int32)
    size = f"{len(types)} nodes, {len(edges)} edges"

    def random_walks() -> int:
        return len([encode(types, edges, alphabet, rng) for _ in range(BATCH)])

    def canonical_walks() -> int:
        return len([canonical_string(types, edges, alphabet) for _ in range(BATCH)])

    def decoding() -> int:
        return len([decode(each, alphabet) for each in strings])

    def sparse6_writing() -> int:
        return len([nx.to_sparse6_bytes(graph) for _ in range(BATCH)])

    def sparse6_reading() -> int:
        return len([nx.from_sparse6_bytes(text) for _ in range(BATCH)])

    def digests() -> int:
        return len([graph_digest(types, edges) for _ in range(BATCH)])

    def docking_digests() -> int:
        return len([docking_digest(types, edges, labels) for _ in range(BATCH)])

    def hashes() -> int:
        return len([nx.weisfeiler_lehman_graph_hash(graph, node_attr="type") for _ in range(BATCH)])

    writing, reading, hashing = (rate(each, 0.5) for each in (sparse6_writing, sparse6_reading, hashes))
    yield Measure(f"random strings, {size}", "strings", rate(random_walks, 0.5), "networkx sparse6", writing)
    yield Measure(f"canonical strings, {size}", "strings", rate(canonical_walks, 0.5), "networkx sparse6", writing)
    yield Measure(f"strings decoded, {size}", "strings", rate(decoding, 0.5), "networkx sparse6", reading)
    note = "the peer is not exact"
    yield Measure(f"graph digests, {size}", "graphs", rate(digests, 0.5), "networkx WL hash", hashing, note)
    yield Measure(f"docking digests, {size}", "graphs", rate(docking_digests, 0.5), "networkx WL hash", hashing, note)
