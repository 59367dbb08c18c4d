"""Check samples that are exemplars in other proportions."""

from __future__ import annotations

from collections.abc import Iterator

from pipeline.paths import DatasetPaths
from stages.exemplars.language import dataset_kits
from stages.proportions.language import LANGUAGE
from stages.proportions.text import ProportionError, ProportionShapes, proportion_text, read_proportions
from stages.proportions.warp_check import warp_fault
from stages.shape.collection.audit import Audit
from stages.shape.collection.packaged import PackagedSample


def _recheck(sample: PackagedSample, paths: DatasetPaths) -> Iterator[str]:
    """Read and write the text again, and check that the shape keeps the contacts of its exemplar."""
    record = sample.record
    if record["language"] != LANGUAGE.name:
        return
    shapes = ProportionShapes(dataset_kits(paths)[record["kit"]])
    try:
        proportions = read_proportions(record["text"])
        unwarped = shapes.unwarped(proportions.exemplar, proportions.changes)
        fault = warp_fault(shapes.kit, unwarped.assembly, shapes.warped(unwarped, proportions.warp))
    except ProportionError as error:
        yield str(error)
        return
    if proportion_text(proportions) != record["text"]:
        yield "its proportions read and written again give another text"
    if fault is not None:
        yield f"compared with its exemplar: {fault}"


AUDIT = Audit(recheck=_recheck)
