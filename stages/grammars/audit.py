"""How `make verify` checks samples that are derivations of a grammar."""

from __future__ import annotations

from collections.abc import Iterator

from pipeline.paths import DatasetPaths
from stages.grammars.derivation_text import format_derivation, parse_derivation
from stages.grammars.derived_shape import placed_terminals, surface_digest
from stages.grammars.files import load_grammars
from stages.grammars.language import LANGUAGE
from stages.shape.collection.audit import Audit
from stages.shape.collection.packaged import PackagedSample


def _recheck(sample: PackagedSample, paths: DatasetPaths) -> Iterator[str]:
    """Parse and format the text again, and compare the surface that it makes with the digest in the record."""
    record = sample.record
    if record["language"] != LANGUAGE.name:
        return
    grammar = load_grammars(paths)[record["kit"]]
    derivation = parse_derivation(grammar, record["text"])
    if format_derivation(grammar, derivation) != record["text"]:
        yield "its derivation is not written as the grammar writes it"
    if surface_digest(grammar, placed_terminals(grammar, derivation)) != record["graph"]:
        yield "its derivation makes another surface than its json names"


AUDIT = Audit(recheck=_recheck)
