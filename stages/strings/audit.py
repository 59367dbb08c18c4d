"""Checks that the strings of a sample encode its shape graph, or the part of it that they should contain."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np

from pipeline.paths import DatasetPaths
from stages.shape.arrays import IntArray, TypeArray
from stages.shape.collection.audit import Audit
from stages.shape.collection.discovery import languages
from stages.shape.collection.members import TEXT
from stages.shape.collection.packaged import PackagedSample
from stages.shape.graphs.canonical import graph_digest
from stages.shape.kit_files import load_kit
from stages.strings.decoder import Decoded, decode
from stages.strings.encoder import canonical_string
from stages.strings.kit_strings import KitStrings
from stages.strings.settings import Edges, StringsConfig
from stages.strings.tokens import StringError, make_alphabet


def string_faults(sample: PackagedSample) -> Iterator[str]:
    """Yield a sentence for a shape graph other than the record's, and for strings of another graph."""
    if not languages()[sample.record["language"]].graphs:
        return
    types = sample.shape.part_labels
    if graph_digest(types, sample.contacts) != sample.record["graph"]:
        yield "its parts and contacts are another graph than its json names"
        return
    if not _has_strings(sample):
        return
    edges, alphabet = _edges(sample), make_alphabet(sample.shape.labels)
    lines = sample.members["txt"].decode().splitlines()
    decoded = []
    for number, string in enumerate(lines):
        try:
            decoded.append(decode(string, alphabet))
        except StringError as error:
            yield f"line {number + 1} of its txt is no string: {error}"
            return
    for number, graph in enumerate(decoded):
        if not _can_encode(graph, types, sample.contacts, edges):
            yield f"line {number + 1} of its txt encodes another graph"
            return
    first = decoded[0]
    if edges == "all" and graph_digest(first.types, first.edges) != sample.record["graph"]:
        yield "the first line of its txt encodes another graph"
    if edges == "faces" and len({graph_digest(graph.types, graph.edges) for graph in decoded}) > 1:
        yield "the lines of its txt encode different graphs"
    if edges == "tree" and lines[0] != canonical_string(types, sample.contacts, alphabet, cycles=False).string:
        yield "the first line of its txt is not the canonical spanning tree"


def _contact_mismatches(sample: PackagedSample, places: DatasetPaths) -> Iterator[str]:
    """Check face contacts with the kit; it does not know those of stretched parts."""
    if not languages()[sample.record["language"]].graphs or _edges(sample) != "faces" or sample.shape.is_stretched:
        return
    if not _has_strings(sample):
        return
    path = places.stage("exemplars").root / f"{sample.record['kit']}.json"
    kit = KitStrings(load_kit(path, path.with_suffix(".tar")), "faces")
    graph = kit.graph(sample.shape.assembly)
    first = decode(sample.members["txt"].decode().split("\n", 1)[0], kit.alphabet)
    if graph_digest(first.types, first.edges) != graph_digest(graph.types, graph.edges):
        yield "its txt does not contain its face contacts"


def _has_strings(sample: PackagedSample) -> bool:
    """Return whether the text of a shape graph is its strings: a mixture without strings has another text."""
    return TEXT in sample.members and _settings(sample).enabled


def _edges(sample: PackagedSample) -> Edges:
    """Return which contacts the strings of the dataset contain."""
    return _settings(sample).edges


def _settings(sample: PackagedSample) -> StringsConfig:
    return StringsConfig.model_validate(sample.sections.get("strings", {}))


def _can_encode(decoded: Decoded, types: TypeArray, contacts: IntArray, edges: Edges) -> bool:
    """Return whether a decoded string can encode a graph: equal nodes, the right number of edges, possible neighbours.

    Without some of the edges, more would need a search.
    """
    if sorted(decoded.types.tolist()) != sorted(types.tolist()):
        return False
    if edges != "all" and not all(
        any(neighbours <= full for full in _neighbourhoods(types, contacts)[kind])
        for kind, of_kind in _neighbourhoods(decoded.types, decoded.edges).items()
        for neighbours in of_kind
    ):
        return False
    wanted = {"all": len(contacts), "faces": len(decoded.edges), "tree": len(types) - 1}[edges]
    return len(decoded.edges) == wanted <= len(contacts)


def _neighbourhoods(types: TypeArray, edges: Sequence[Sequence[int]] | IntArray) -> dict[int, list[Counter[int]]]:
    """Return the distinct neighbourhoods of the nodes of each type."""
    kinds = types.tolist()
    neighbours: list[list[int]] = [[] for _ in kinds]
    for i, j in np.asarray(edges).tolist():
        neighbours[i].append(kinds[j])
        neighbours[j].append(kinds[i])
    distinct: dict[int, dict[tuple[int, ...], Counter[int]]] = {}
    for kind, of_node in zip(kinds, neighbours, strict=True):
        distinct.setdefault(kind, {})[tuple(sorted(of_node))] = Counter(of_node)
    return {kind: list(multisets.values()) for kind, multisets in distinct.items()}


AUDIT = Audit(faults=string_faults, recheck=_contact_mismatches)
