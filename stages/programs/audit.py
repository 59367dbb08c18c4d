"""The checks of `make verify` for samples that are parameters of a program."""

from __future__ import annotations

from collections.abc import Iterator

from stages.programs.language import LANGUAGE
from stages.programs.program import find_program
from stages.programs.sampling import structure_digest
from stages.shape.collection.audit import Audit
from stages.shape.collection.packaged import PackagedSample


def _faults(sample: PackagedSample) -> Iterator[str]:
    record = sample.record
    if record["language"] == LANGUAGE.name:
        program = find_program(record["kit"])
        if structure_digest(program, program.schema.from_text(record["text"])) != record["graph"]:
            yield "its parameters have another structure than its json says"


AUDIT = Audit(faults=_faults)
