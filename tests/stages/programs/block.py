"""A block: a program of two parameters and six shapes."""

from __future__ import annotations

from stages.programs.curves import Part, box
from stages.programs.parameters import continuous
from stages.programs.program import Program

PROGRAM = Program(
    name="block",
    description="A block.",
    parameters=(
        continuous("width", 1, 2, 2, 1, "size", "Its width."),
        continuous("height", 1, 2, 3, 1, "size", "Its height."),
    ),
    labels=("block",),
    build=lambda values: [Part("block", box((values["width"], values["height"], 1)), (180, 120, 90))],
)
