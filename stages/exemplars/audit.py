"""How `make verify` checks samples that are assemblies of a kit's parts."""

from __future__ import annotations

from collections.abc import Iterator

from pipeline.paths import DatasetPaths
from stages.exemplars.language import LANGUAGE, dataset_kits
from stages.shape.assembly_faults import geometry_faults
from stages.shape.collection.audit import Audit
from stages.shape.collection.packaged import PackagedSample


def _check(sample: PackagedSample, places: DatasetPaths) -> Iterator[str]:
    """Check contacts, grammar and penetration, from the meshes in the sample's file."""
    if sample.record["language"] == LANGUAGE.name:
        yield from geometry_faults(dataset_kits(places)[sample.record["kit"]], sample.members)


AUDIT = Audit(recheck=_check)
