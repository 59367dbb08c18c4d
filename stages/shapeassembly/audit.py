"""How `shapemill verify` checks samples that are ShapeAssembly programs."""

from __future__ import annotations

from collections.abc import Iterator

from stages.shape.collection.audit import Audit
from stages.shape.collection.packaged import PackagedSample
from stages.shapeassembly.analysis.structure import signature
from stages.shapeassembly.language import LANGUAGE
from stages.shapeassembly.syntax.parser import parse


def _faults(sample: PackagedSample) -> Iterator[str]:
    record = sample.record
    if record["language"] == LANGUAGE.name and signature(parse(record["text"])) != record["graph"]:
        yield "its program has another signature than its json states"


AUDIT = Audit(faults=_faults)
