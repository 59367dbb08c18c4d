"""A rack of boards: a program of many structures, a dozen numbers of boards with and without a top."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stages.programs.parameters import binary, continuous, discrete
from stages.programs.program import Program
from stages.programs.schema import Values
from stages.shape.kit import PartMesh
from tests.stages.shape.bodies import box


def build(values: Values) -> Sequence[PartMesh]:
    bodies = [box(values["width"], 0.1, 1, at=(0, 0.1 * number, 0)) for number in range(values["boards"])]
    labelled = [("board", body) for body in bodies]
    if values["has_top"]:
        labelled.append(("top", box(1, 0.1, 1, at=(0, 0.1 * len(bodies), 0))))
    return [PartMesh(label, *body, np.full((len(body[1]), 3), 180, dtype=np.uint8)) for label, body in labelled]


PROGRAM = Program(
    name="rack",
    sentence="A rack of boards.",
    parameters=(
        discrete("boards", 1, 12, 3, "boards", "Number of boards."),
        continuous("width", 0.5, 2.0, 4, 1.0, "boards", "Width of the boards."),
        binary("has_top", True, "top", "Whether there is a top."),
    ),
    labels=("board", "top"),
    build=build,
)
