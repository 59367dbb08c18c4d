"""A stool of boxes: the smallest program with all features of programs."""

from __future__ import annotations

from collections.abc import Sequence

from stages.programs.conditions import Condition
from stages.programs.curves import Part, box
from stages.programs.parameters import binary, continuous
from stages.programs.program import Constraint, Program
from stages.programs.schema import Values

GREY = (180, 180, 180)


def build(values: Values) -> Sequence[Part]:
    height, width = values["height"], values["scale x"]
    seat = Part("seat", box((width, 0.1, 0.8), (0, height + 0.05, 0)), GREY)
    legs = [
        Part("leg", box((0.1, height, 0.8), (x, height / 2, 0)), GREY) for x in (0.05 - width / 2, width / 2 - 0.05)
    ]
    rail = Part("rail", box((width - 0.2, 0.1, 0.1), (0, values["rail_height"], 0)), GREY)
    return [seat, *legs, rail] if values["has_rail"] else [seat, *legs]


PROGRAM = Program(
    name="stool",
    description="A stool of boxes, with or without a rail between its legs.",
    parameters=(
        continuous("height", 0.3, 1.0, 8, 0.6, "seat", "Height of the seat."),
        continuous("scale x", 0.4, 1.1, 8, 0.5, "seat", "Width of the seat."),
        binary("has_rail", True, "rail", "Whether a rail joins the legs."),
        continuous("rail_height", 0.1, 0.6, 6, 0.3, "rail", "Height of the rail.", visible_if="has_rail"),
    ),
    labels=("seat", "leg", "rail"),
    build=build,
    constraints=(
        Constraint(
            "rail_above_seat", Condition("height >= rail_height"), "A rail above the seat would hang in the air."
        ),
    ),
    non_intersecting=(("seat", "rail"),),
)
