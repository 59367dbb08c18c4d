"""A box with or without a lid: the smallest programs that random sampling must finish."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from stages.programs.curves import Part, box
from stages.programs.parameters import binary, continuous
from stages.programs.program import Program
from stages.programs.schema import Values

GREY = (180, 180, 180)


def build(values: Values) -> Sequence[Part]:
    width = values.get("width", 1.0)
    case = Part("case", box((width, 1, 1), (0, 0.5, 0)), GREY)
    lid = Part("lid", box((width, 0.1, 1), (0, 1.05, 0)), GREY)
    return [case, lid] if values.get("has_lid", True) else [case]


LID = binary("has_lid", True, "lid", "Whether there is a lid.")
WIDTH = continuous("width", 0.5, 1.5, 4, 1.0, "case", "How wide it is.")

PROGRAM = Program(
    name="lid", description="A box with or without a lid.", parameters=(LID,), labels=("case", "lid"), build=build
)
WIDE = replace(PROGRAM, parameters=(LID, WIDTH))
FIXED = replace(PROGRAM, parameters=())
