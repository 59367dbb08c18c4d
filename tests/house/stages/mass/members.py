"""What stage `mass` adds to every sample."""

from __future__ import annotations

from collections.abc import Iterator

from stages.shape.collection.members import Column, Field, Member, Members
from stages.shape.collection.packaged import Packaged


def _faults(sample: Packaged) -> Iterator[str]:
    if abs(float(sample.arrays["mass.npy"].sum()) - sample.record["total_mass"]) > 0.01:
        yield "the masses of its parts do not add up to its total_mass"


MEMBERS = Members(
    of=lambda _: (Member("mass.npy", "Mass of each part.", "float32", ("parts",)),),
    fields=lambda _: {"total_mass": Field({"type": "number", "minimum": 0, "description": "mass of all parts"})},
    columns={"total_mass": Column("float64", ("total_mass",))},
    faults=_faults,
)
