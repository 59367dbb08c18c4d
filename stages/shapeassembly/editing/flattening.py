"""Programs of one assembly: the leaf cuboids of a hierarchical one, extracted again (shapeassembly §7.1.1, "flat")."""

from __future__ import annotations

import numpy as np

from stages.shapeassembly.execution.interpreter import execute
from stages.shapeassembly.extraction.boxes import around, box_corners
from stages.shapeassembly.extraction.category_rules import RULES
from stages.shapeassembly.extraction.extract import extract
from stages.shapeassembly.extraction.hierarchy import Part, PartHierarchy
from stages.shapeassembly.extraction.settings import Cleaning, Gates
from stages.shapeassembly.extraction.validity import boxes_of
from stages.shapeassembly.syntax.limits import MAX_PARTS
from stages.shapeassembly.syntax.program import Program

GATES = Gates(fewest_leaves=1, most_leaves=MAX_PARTS)
"""The fit that an extracted program must have, and nothing about its size."""


NO_ASSEMBLIES = Cleaning(pool=False)


def without_hierarchy(program: Program) -> Program:
    """A program of about the same shape with one assembly, its parts attached to each other as they touch.

    Raises Rejected as `extract`, above all for more than ten cuboids, and ProgramError where the program cannot be
    executed.
    """
    boxes = boxes_of(execute(program))
    whole = around(np.concatenate([box_corners(box) for box in boxes]), np.eye(3))
    root = Part("shape", whole, tuple(Part("part", box) for box in boxes))
    return extract(PartHierarchy(program.root.name, root), RULES["any"], GATES, NO_ASSEMBLIES).program
