"""What stage `mass` adds to every sample."""

from __future__ import annotations

from stages.shape.collection.members import Column, Field, Member, Members

MEMBERS = Members(
    of=lambda _: (Member("mass.npy", "Mass of each part.", "float32", ("parts",)),),
    fields=lambda _: {"total_mass": Field({"type": "number", "minimum": 0, "description": "mass of all parts"})},
    columns={"total_mass": Column("float64", ("total_mass",))},
)
