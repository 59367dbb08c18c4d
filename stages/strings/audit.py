"""Do the strings of a sample stand for its shape graph?"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from stages.shape.collection.audit import Audit
from stages.shape.collection.declared import languages
from stages.shape.collection.packaged import Packaged
from stages.shape.graphs.canonical import graph_digest
from stages.strings.alphabet import make_alphabet
from stages.strings.decoder import decode
from stages.strings.tokens import StringError

__all__ = ["AUDIT", "string_faults"]


def string_faults(sample: Packaged) -> Iterator[str]:
    """A sentence for a shape graph that is not the record's, and for strings that stand for another graph."""
    if not languages()[sample.record["language"]].graphs:
        return
    types = sample.shape.part_labels
    if graph_digest(types, sample.contacts) != sample.record["graph"]:
        yield "its parts and contacts are another graph than its json names"
        return
    counts = np.bincount(types, minlength=len(sample.shape.labels)).tolist()
    alphabet = make_alphabet(sample.shape.labels)
    for number, string in enumerate(sample.members["txt"].decode().splitlines()):
        try:
            decoded = decode(string, alphabet)
        except StringError as error:
            yield f"line {number + 1} of its txt is no string: {error}"
            return
        same_size = len(decoded.edges) == len(sample.contacts)
        if not same_size or np.bincount(decoded.types, minlength=len(counts)).tolist() != counts:
            yield f"line {number + 1} of its txt stands for another graph"
            return
        if number == 0 and graph_digest(decoded.types, decoded.edges) != sample.record["graph"]:
            yield "the first line of its txt stands for another graph"
            return


AUDIT = Audit(faults=string_faults)
