"""Do the strings of a sample stand for its shape graph, or for the part of it that they are to tell of?"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np

from pipeline.paths import DatasetPaths
from stages.shape.arrays import IntArray, TypeArray
from stages.shape.collection.audit import Audit
from stages.shape.collection.discovery import languages
from stages.shape.collection.packaged import PackagedSample
from stages.shape.graphs.canonical import graph_digest
from stages.shape.kit_files import load_kit
from stages.strings.alphabet import make_alphabet
from stages.strings.decoder import Decoded, decode
from stages.strings.encoder import canonical_string
from stages.strings.kit_strings import KitStrings
from stages.strings.settings import Edges, StringsConfig
from stages.strings.tokens import StringError


def string_faults(sample: PackagedSample) -> Iterator[str]:
    """A sentence for a shape graph that is not the record's, and for strings that stand for another graph."""
    if not languages()[sample.record["language"]].graphs:
        return
    types = sample.shape.part_labels
    if graph_digest(types, sample.contacts) != sample.record["graph"]:
        yield "its parts and contacts are another graph than its json names"
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
    for number, each in enumerate(decoded):
        if not _may_stand_for(each, types, sample.contacts, edges):
            yield f"line {number + 1} of its txt stands for another graph"
            return
    first = decoded[0]
    if edges == "all" and graph_digest(first.types, first.edges) != sample.record["graph"]:
        yield "the first line of its txt stands for another graph"
    if edges == "faces" and len({graph_digest(each.types, each.edges) for each in decoded}) > 1:
        yield "the lines of its txt stand for different graphs"
    if edges == "tree" and lines[0] != canonical_string(types, sample.contacts, alphabet, cycles=False).string:
        yield "the first line of its txt is not the canonical spanning tree"


def _anew(sample: PackagedSample, places: DatasetPaths) -> Iterator[str]:
    """Which contacts are faces is asked of the kit again, but of stretched parts it does not know."""
    if not languages()[sample.record["language"]].graphs or _edges(sample) != "faces" or sample.shape.is_stretched:
        return
    path = places.stage("exemplars").root / f"{sample.record['kit']}.json"
    kit = KitStrings(load_kit(path, path.with_suffix(".tar")), "faces")
    graph = kit.graph(sample.shape.assembly)
    first = decode(sample.members["txt"].decode().split("\n", 1)[0], kit.alphabet)
    if graph_digest(first.types, first.edges) != graph_digest(graph.types, graph.edges):
        yield "its txt does not tell of its face contacts"


def _edges(sample: PackagedSample) -> Edges:
    """What the strings of the dataset tell of."""
    return StringsConfig.model_validate(sample.sections.get("strings", {})).edges


def _may_stand_for(decoded: Decoded, types: TypeArray, contacts: IntArray, edges: Edges) -> bool:
    """Whether a decoded string has the nodes of the graph, as many edges as it should, and around no node what stands
    around none of its type: of a graph without some edges no more is told without a search."""
    if sorted(decoded.types.tolist()) != sorted(types.tolist()):
        return False
    if edges != "all" and not all(
        any(around <= whole for whole in _around(types, contacts)[kind])
        for kind, arounds in _around(decoded.types, decoded.edges).items()
        for around in arounds
    ):
        return False
    wanted = {"all": len(contacts), "faces": len(decoded.edges), "tree": len(types) - 1}[edges]
    return len(decoded.edges) == wanted <= len(contacts)


def _around(types: TypeArray, edges: Sequence[Sequence[int]] | IntArray) -> dict[int, list[Counter[int]]]:
    """By type, what stands around the nodes of that type: each different multiset once."""
    kinds = types.tolist()
    neighbours: list[list[int]] = [[] for _ in kinds]
    for i, j in np.asarray(edges).tolist():
        neighbours[i].append(kinds[j])
        neighbours[j].append(kinds[i])
    found: dict[int, dict[tuple[int, ...], Counter[int]]] = {}
    for kind, each in zip(kinds, neighbours, strict=True):
        found.setdefault(kind, {})[tuple(sorted(each))] = Counter(each)
    return {kind: list(each.values()) for kind, each in found.items()}


AUDIT = Audit(faults=string_faults, recheck=_anew)
