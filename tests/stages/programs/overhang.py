"""A plate on a post: the larger the distance of its middle from the post, the less stable it is."""

from __future__ import annotations

from collections.abc import Sequence

from stages.programs.curves import Part, box
from stages.programs.parameters import continuous
from stages.programs.program import Program
from stages.programs.schema import Values

GREY = (150, 150, 150)


def build(values: Values) -> Sequence[Part]:
    post = Part("post", box((0.4, 0.5, 0.4), center=(0, 0.25, 0)), GREY)
    return [post, Part("plate", box((2.0, 0.1, 0.4), center=(values["reach"], 0.545, 0)), GREY)]


PROGRAM = Program(
    name="overhang",
    description="A plate on a post.",
    parameters=(
        continuous("reach", 0.0, 1.0, 11, 0.5, "plate", "How far the plate reaches out."),
        continuous("unused", 0.0, 1.0, 11, 0.5, "plate", "Nothing, so that there are many shapes."),
    ),
    labels=("post", "plate"),
    build=build,
)
