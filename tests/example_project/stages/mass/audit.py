"""How `make verify` looks at masses."""

from __future__ import annotations

from collections.abc import Iterator

from stages.shape.collection.audit import Audit
from stages.shape.collection.packaged import PackagedSample


def _faults(sample: PackagedSample) -> Iterator[str]:
    if abs(float(sample.arrays["mass.npy"].sum()) - sample.record["total_mass"]) > 0.01:
        yield "the masses of its parts do not add up to its total_mass"


AUDIT = Audit(faults=_faults)
