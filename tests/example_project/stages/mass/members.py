"""What stage `mass` adds to every sample."""

from __future__ import annotations

from stages.shape.collection.members import IndexColumn, Member, Members, RecordField

MEMBERS = Members(
    of=lambda _: (Member("mass.npy", "Mass of each part.", "float32", ("parts",)),),
    fields=lambda _: {"total_mass": RecordField({"type": "number", "minimum": 0, "description": "mass of all parts"})},
    columns={"total_mass": IndexColumn("float64", ("total_mass",))},
)
