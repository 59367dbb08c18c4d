"""Check that hierarchy and symmetry of a sample are those of its shape."""

from __future__ import annotations

from collections.abc import Iterator

from pipeline.paths import DatasetPaths
from stages.mixture.contrast import described_language
from stages.shape.collection.audit import Audit
from stages.shape.collection.packaged import PackagedSample
from stages.structure.members import HIERARCHY, SYMMETRY
from stages.structure.settings import StructureConfig
from stages.structure.stage import structure_fields


def structure_faults(sample: PackagedSample) -> Iterator[str]:
    """Yield a sentence for groups without a place in the tree, and for symmetries that exchange parts wrongly."""
    parts = len(sample.record["parts"])
    if HIERARCHY in sample.record:
        groups, part_groups = sample.record[HIERARCHY]["groups"], sample.record[HIERARCHY]["part_groups"]
        if [group["parent"] for group in groups][:1] != [-1] or any(
            not 0 <= group["parent"] < place for place, group in enumerate(groups) if place
        ):
            yield "its hierarchy is no tree with parents first"
        if len(part_groups) != parts or not all(0 <= group < len(groups) for group in part_groups):
            yield "its hierarchy does not have each part in one group"
    if SYMMETRY in sample.record:
        symmetry = sample.record[SYMMETRY]
        orbits = symmetry["orbits"]
        if len(orbits) != parts:
            yield "its symmetry does not have each part in one orbit"
            return
        for operation in symmetry["operations"]:
            if sorted(operation["images"]) != list(range(parts)):
                yield f"its {operation['kind']} by {operation['degrees']} degrees does not exchange its parts"
            elif any(orbits[part] != orbits[image] for part, image in enumerate(operation["images"])):
                yield f"its {operation['kind']} by {operation['degrees']} degrees leaves an orbit"


def recomputed_structure_faults(sample: PackagedSample, _: DatasetPaths) -> Iterator[str]:
    """Yield a sentence for a hierarchy or a symmetry that the shape does not have."""
    config = StructureConfig.model_validate(sample.sections.get("structure", {}))
    language = described_language(sample.record["language"], sample.record.get("text", ""))
    fields = structure_fields(sample.shape, language, config)
    if HIERARCHY in fields and fields[HIERARCHY] != sample.record[HIERARCHY]:
        yield "its hierarchy is not that of its text"
    if SYMMETRY in fields:
        for name in ("operations", "orbits"):
            if fields[SYMMETRY][name] != sample.record[SYMMETRY][name]:
                yield f"the {name} of its symmetry are not those of its shape"


AUDIT = Audit(faults=structure_faults, recheck=recomputed_structure_faults)
