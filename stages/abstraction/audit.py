"""Verification of the ShapeAssembly programs of samples."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from stages.abstraction.members import PROGRAM, PROGRAM_FOUND
from stages.shape.collection.audit import Audit
from stages.shape.collection.packaged import PackagedSample
from stages.shape.geometry.bounds import shape_bounds
from stages.shapeassembly.execution.interpreter import execute
from stages.shapeassembly.syntax.errors import ProgramError
from stages.shapeassembly.syntax.parser import parse

MAX_CORNER_SHARE = 0.35
"""Distance between the corners of the bounding boxes of program and sample, as a share of the sample's diagonal.

Programs are accepted by their surface, so parts may reach out a little."""


def _faults(sample: PackagedSample) -> Iterator[str]:
    if PROGRAM not in sample.members:
        return
    entry, text = sample.record["program"], sample.members[PROGRAM].decode()
    if bool(text) != (entry["refused"] == PROGRAM_FOUND):
        yield "it has a ShapeAssembly program and a reason why it has none, or neither"
        return
    if not text:
        return
    try:
        program = parse(text)
        corners = execute(program).corners.reshape(-1, 3)
    except ProgramError as error:
        yield f"its ShapeAssembly program: {error}"
        return
    if sum(1 + len(block.lines) for block in program.blocks) != entry["lines"]:
        yield "its ShapeAssembly program has another number of lines than its json states"
    bounds = shape_bounds(sample.shape)
    placed = np.array(entry["centre"]) + entry["scale"] * np.stack([corners.min(axis=0), corners.max(axis=0)])
    if np.abs(placed - bounds).max() > MAX_CORNER_SHARE * np.linalg.norm(bounds[1] - bounds[0]):
        yield "its ShapeAssembly program is elsewhere than its mesh"


AUDIT = Audit(faults=_faults)
