"""Programs of one assembly: the leaf cuboids of a hierarchical one, extracted again (shapeassembly §7.1.1, "flat")."""

from __future__ import annotations

import numpy as np

from stages.shapeassembly.execution.interpreter import execute
from stages.shapeassembly.extraction.boxes import bounding_box, corners_of_box
from stages.shapeassembly.extraction.category_rules import CATEGORY_RULES
from stages.shapeassembly.extraction.extract import extract
from stages.shapeassembly.extraction.hierarchy import PartHierarchy, PartNode
from stages.shapeassembly.extraction.settings import Cleaning, Gates
from stages.shapeassembly.extraction.validity import execution_boxes
from stages.shapeassembly.syntax.limits import MAX_PARTS
from stages.shapeassembly.syntax.program import AssemblyProgram

FIT_ONLY_GATES = Gates(min_leaves=1, max_leaves=MAX_PARTS)
"""The gates of an extracted program without those on its size."""


WITHOUT_POOLING = Cleaning(pool=False)


def without_hierarchy(program: AssemblyProgram) -> AssemblyProgram:
    """Return a program of about the same shape with one assembly, whose parts are attached where they touch.

    Raises Rejected as `extract`, above all for more than ten cuboids, and ProgramError where the program cannot be
    executed.
    """
    boxes = execution_boxes(execute(program))
    whole = bounding_box(np.concatenate([corners_of_box(box) for box in boxes]), np.eye(3))
    root = PartNode("shape", whole, tuple(PartNode("part", box) for box in boxes))
    return extract(
        PartHierarchy(program.root.name, root), CATEGORY_RULES["any"], FIT_ONLY_GATES, WITHOUT_POOLING
    ).program
