"""How `make verify` looks at samples that are derivations of a grammar."""

from __future__ import annotations

from collections.abc import Iterator

from pipeline.paths import DatasetPaths
from stages.grammars.derivation_text import format_derivation, parse_derivation, placed_terminals, surface_digest
from stages.grammars.files import load_grammars
from stages.grammars.language import LANGUAGE
from stages.shape.collection.audit import Audit
from stages.shape.collection.packaged import PackagedSample


def _anew(sample: PackagedSample, places: DatasetPaths) -> Iterator[str]:
    """The text is read, and written again, and the surface that it makes is the one of which the record has a
    digest."""
    record = sample.record
    if record["language"] != LANGUAGE.name:
        return
    grammar = load_grammars(places)[record["kit"]]
    made = parse_derivation(grammar, record["text"])
    if format_derivation(grammar, made) != record["text"]:
        yield "its derivation is written in another way than the grammar writes it"
    if surface_digest(grammar, placed_terminals(grammar, made)) != record["graph"]:
        yield "its derivation makes another surface than its json names"


AUDIT = Audit(recheck=_anew)
