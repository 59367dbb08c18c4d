"""A stool of boxes: the smallest program that has all that programs have."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stages.programs.parameters import binary, continuous
from stages.programs.program import Constraint, Program
from stages.programs.rules import Rule
from stages.programs.schema import Values
from stages.shape.kit import PartMesh
from tests.stages.shape.bodies import box


def build(values: Values) -> Sequence[PartMesh]:
    height, width = values["height"], values["scale x"]
    seat = _box("seat", (width, 0.1, 0.8), (0, height + 0.05, 0))
    legs = [_box("leg", (0.1, height, 0.8), (side * (width / 2 - 0.05), height / 2, 0)) for side in (-1, 1)]
    parts = [seat, *legs]
    if values["has_rail"]:
        parts.append(_box("rail", (width - 0.2, 0.1, 0.1), (0, values["rail_height"], 0)))
    return parts


def _box(label: str, size: tuple[float, float, float], at: tuple[float, float, float]) -> PartMesh:
    vertices, faces = box(*size, at=at)
    return PartMesh(label, vertices, faces, np.full((len(faces), 3), 180, dtype=np.uint8))


PROGRAM = Program(
    name="stool",
    sentence="A stool of boxes, with or without a rail between its legs.",
    parameters=(
        continuous("height", 0.3, 1.0, 8, 0.6, "seat", "Height of the seat."),
        continuous("scale x", 0.4, 1.1, 8, 0.5, "seat", "Width of the seat."),
        binary("has_rail", True, "rail", "Whether a rail joins the legs."),
        continuous("rail_height", 0.1, 0.6, 6, 0.3, "rail", "Height of the rail.", visible_if="has_rail"),
    ),
    labels=("seat", "leg", "rail"),
    build=build,
    constraints=(
        Constraint("rail_above_seat", Rule("height >= rail_height"), "A rail above the seat would hang in the air."),
    ),
    apart=(("seat", "rail"),),
)
