"""Extract a ShapeAssembly program from a part hierarchy, and check it (shapeassembly §5, App. C)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.errors import Rejected
from stages.shape.arrays import FloatArray
from stages.shapeassembly.execution.interpreter import execute
from stages.shapeassembly.extraction.arrangement import arrange_parts, frame_parts, leaf_corners
from stages.shapeassembly.extraction.boxes import bounding_box
from stages.shapeassembly.extraction.category_rules import CategoryRules
from stages.shapeassembly.extraction.hierarchy import Box, PartHierarchy, PartNode
from stages.shapeassembly.extraction.program_builder import GroupMode, PartOrder, build_program
from stages.shapeassembly.extraction.settings import EVERY_STEP, Cleaning, Gates
from stages.shapeassembly.extraction.shortening import shorten_parts
from stages.shapeassembly.extraction.validity import box_f_score, execution_boxes, is_rooted
from stages.shapeassembly.syntax.checks import overflow, violations
from stages.shapeassembly.syntax.printer import rounded_program
from stages.shapeassembly.syntax.program import AssemblyProgram

KEPT_DIAGONALS = (1.0, 4.0)
"""Shapes with a bounding box of such a diagonal keep their size; PartNet's have the size of the unit sphere."""

TARGET_DIAGONAL = 2.0
"""Diagonal to which other shapes are scaled."""


@dataclass(frozen=True)
class ExtractedProgram:
    """A program that passed every gate.

    program: centred at the origin, with numbers to three decimals.
    f_score: 0 to 100, against the leaf boxes of the input.
    overflow: excess of parts over the bounding box, as a share of its size.
    leaves: declared cuboids that are not expanded.
    center, scale: (3,) and a number; point p of the program is `center + scale * p` in the input.
    input_boxes, boxes: leaf boxes of the input and of the executed program, in the program's frame.
    """

    program: AssemblyProgram
    f_score: float
    overflow: float
    leaves: int
    center: FloatArray
    scale: float
    input_boxes: tuple[Box, ...]
    boxes: tuple[Box, ...]


def extract(
    hierarchy: PartHierarchy, rules: CategoryRules, gates: Gates, cleaning: Cleaning = EVERY_STEP
) -> ExtractedProgram:
    """Return the canonical program of a part hierarchy.

    Raises Rejected with one of these reasons: "too few parts", "too many parts", "flat shape", "parts not connected",
    "breaks a rule of the language", "poor fit", "overflows its box", "not rooted".
    """
    whole = bounding_box(leaf_corners(hierarchy.root), np.eye(3))
    diagonal = float(np.linalg.norm(whole.size))
    if diagonal <= 0:
        raise Rejected("flat shape", f"{hierarchy.name} has no extent")
    scale = 1.0 if KEPT_DIAGONALS[0] <= diagonal <= KEPT_DIAGONALS[1] else diagonal / TARGET_DIAGONAL
    root = _rescaled(hierarchy.root, whole.center, scale)
    shape = _Shape(hierarchy.name, tuple(leaf.box for leaf in root.leaves()), whole.center, scale)
    first: Rejected | None = None
    for steps in _attempts(cleaning):
        try:
            return _attempt(shape, root, rules, gates, steps)
        except Rejected as reason:
            first = first or reason
            if reason.reason == "too few parts" or (reason.reason == "too many parts" and steps.groups == "common"):
                break
    assert first is not None
    raise first


@dataclass(frozen=True)
class _Steps:
    """The steps of an attempt."""

    shorten: bool
    arrange: bool
    pool: bool
    groups: GroupMode


def _attempts(cleaning: Cleaning) -> list[_Steps]:
    """Return the configured steps, then fallbacks for a shape whose program fails.

    - Groups of parts with a common attachment only: more parts are made by macros.
    - No shortening: sunk ends may be what connects a shape.
    - No groups: a part between two members of a group may have nothing to attach to.
    """
    configured = _Steps(cleaning.shorten, cleaning.arrange, cleaning.pool, "alike" if cleaning.group else "none")
    if not cleaning.group:
        return [configured]
    fallbacks = [replace(configured, groups="common"), replace(configured, groups="none")]
    return [
        configured,
        fallbacks[0],
        *([replace(fallbacks[0], shorten=False)] if cleaning.shorten else []),
        fallbacks[1],
    ]


@dataclass(frozen=True)
class _Shape:
    """The input of an attempt, see ExtractedProgram."""

    name: str
    input_boxes: tuple[Box, ...]
    center: FloatArray
    scale: float


def _attempt(shape: _Shape, root: PartNode, rules: CategoryRules, gates: Gates, steps: _Steps) -> ExtractedProgram:
    if steps.shorten:
        root = shorten_parts(root)
    root = frame_parts(arrange_parts(root, rules) if steps.arrange else root)
    if not root.children:
        raise Rejected("too few parts", f"{shape.name} is one box")
    program = rounded_program(build_program(root, part_order_key(rules), steps.groups, steps.pool))
    named = set(program.named)
    leaves = sum(cuboid.name not in named for block in program.blocks for cuboid in block.cuboids)
    if leaves < gates.min_leaves:
        raise Rejected("too few parts", f"{shape.name} has {leaves}, at least {gates.min_leaves} are wanted")
    if leaves > gates.max_leaves:
        raise Rejected("too many parts", f"{shape.name} has {leaves}, at most {gates.max_leaves} are wanted")
    return _checked(shape, program, leaves, gates)


def part_order_key(rules: CategoryRules) -> PartOrder:
    """Return the sort key of parts: semantic label, then bottom to top, left to right, back to front."""
    ranks = {label: rank for rank, label in enumerate(rules.order)}

    def key(part: PartNode) -> tuple[object, ...]:
        x, y, z = np.round(part.box.center, 3).tolist()
        size = np.round(part.box.size, 3).tolist()
        return (ranks.get(part.label, len(ranks)), part.label if ranks else "", y, x, z, *size)

    return key


def _checked(shape: _Shape, program: AssemblyProgram, leaves: int, gates: Gates) -> ExtractedProgram:
    # As in the published programs, a tilted part may be longer than the bounding box is wide.
    broken = [violation for violation in violations(program) if violation.rule != "size"]
    if broken:
        raise Rejected("breaks a rule of the language", f"{shape.name}: {broken[0]}")
    execution = execute(program)
    boxes = tuple(execution_boxes(execution))
    diagonal = float(np.linalg.norm(program.root.bbox.dims))
    score = box_f_score(boxes, shape.input_boxes, gates.distance * diagonal)
    if not score >= gates.min_f_score:
        raise Rejected("poor fit", f"{shape.name} has F-score {score:.1f}, at least {gates.min_f_score:g} is wanted")
    excess = overflow(program, execution)
    if excess >= gates.max_overflow:
        raise Rejected("overflows its box", f"{shape.name} by {excess:.1%}, at most {gates.max_overflow:.0%}")
    if not is_rooted(boxes):
        raise Rejected("not rooted", f"{shape.name} has a part without a way to the ground")
    return ExtractedProgram(program, score, excess, leaves, shape.center, shape.scale, shape.input_boxes, boxes)


def _rescaled(part: PartNode, center: FloatArray, scale: float) -> PartNode:
    box = Box((part.box.center - center) / scale, part.box.size / scale, part.box.axes)
    return replace(part, box=box, children=tuple(_rescaled(child, center, scale) for child in part.children))
