"""A rack of boards: a program with many structures, a dozen numbers of boards with and without a top."""

from __future__ import annotations

from collections.abc import Sequence

from stages.programs.curves import Part, box
from stages.programs.parameters import binary, continuous, discrete
from stages.programs.program import Program
from stages.programs.schema import Values

GREY = (180, 180, 180)


def build(values: Values) -> Sequence[Part]:
    count = values["boards"]
    boards = [Part("board", box((values["width"], 0.1, 1), (0, 0.1 * number, 0)), GREY) for number in range(count)]
    top = Part("top", box((1, 0.1, 1), (0, 0.1 * count, 0)), GREY)
    return [*boards, top] if values["has_top"] else boards


PROGRAM = Program(
    name="rack",
    description="A rack of boards.",
    parameters=(
        discrete("boards", 1, 12, 3, "boards", "Number of boards."),
        continuous("width", 0.5, 2.0, 4, 1.0, "boards", "Width of the boards."),
        binary("has_top", True, "top", "Whether there is a top."),
    ),
    labels=("board", "top"),
    build=build,
)
