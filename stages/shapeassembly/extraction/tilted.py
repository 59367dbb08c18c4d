"""Place a tilted part by the attachments that turn it nearest to its input (shapeassembly §5.2)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import permutations

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shapeassembly.execution.interpreter import execute_all
from stages.shapeassembly.execution.parameters import MIN_CUBOID_SIZE
from stages.shapeassembly.extraction.boxes import corners_of_box
from stages.shapeassembly.extraction.grounding import TiltedPlacement, TiltedPlacer
from stages.shapeassembly.extraction.hierarchy import Box
from stages.shapeassembly.extraction.joints import (
    BACK,
    BOTTOM,
    LEFT,
    TOP,
    Joint,
    PlacedBoxes,
    attach_line,
    part_name,
    squeeze,
)
from stages.shapeassembly.extraction.node_layout import BBOX_INDEX, NodeLayout
from stages.shapeassembly.extraction.validity import execution_boxes
from stages.shapeassembly.syntax.printer import rounded_program
from stages.shapeassembly.syntax.program import BBOX as BBOX_NAME
from stages.shapeassembly.syntax.program import AssemblyProgram, Block, Cuboid

MAX_ATTACHMENTS = 3
"""Three points hold a part."""

MAX_CONTACTS_TRIED = 5
"""Contacts of one part that are tried, in canonical order; they have 85 sequences."""

LINE_COST = 0.002
"""Misplacement, as a share of the bounding box's diagonal, that one line less is worth."""


def declaration_of(layout: NodeLayout, part: int) -> Cuboid:
    """Return the declaration of a part."""
    x, y, z = np.maximum(layout.parts[part].box.size, MIN_CUBOID_SIZE).tolist()
    return Cuboid(part_name(part), (x, y, z), layout.aligned(part))


def tilted_placer(layout: NodeLayout) -> TiltedPlacer:
    """Return a placer that tries the attachments of a part in every order and executes each sequence.

    The best brings the corners nearest to the input, with a penalty for each line.
    """

    known: dict[tuple[int, ...], TiltedPlacement | None] = {}

    def place(part: int, lines: list[Joint], placed: PlacedBoxes) -> TiltedPlacement | None:
        about = (part, *(other for other in layout.neighbours(part) if other in placed))
        if about not in known:
            known[about] = _best(layout, part, lines, placed)
        return known[about]

    return place


def _best(layout: NodeLayout, part: int, lines: list[Joint], placed: PlacedBoxes) -> TiltedPlacement | None:
    wanted = corners_of_box(layout.parts[part].box)
    candidates = list(_candidates(layout, part, placed))
    best: TiltedPlacement | None = None
    for candidate, box in zip(candidates, _executed(layout, part, lines, candidates, placed), strict=True):
        away = float(np.linalg.norm(corners_of_box(box) - wanted, axis=1).mean()) / layout.diagonal
        cost = away + LINE_COST * len(candidate)
        if best is None or cost < best.cost - 1e-6:
            best = TiltedPlacement(tuple(candidate), box, cost)
    return best


def _candidates(layout: NodeLayout, part: int, placed: PlacedBoxes) -> Iterator[list[Joint]]:
    """Yield sequences of lines that could ground a part: squeezes, then attachments in every order."""
    others = [other for other in layout.neighbours(part) if other in placed and layout.may_attach(part, other)]
    at_box = [(BBOX_INDEX, BBOX_INDEX), *((BBOX_INDEX, other) for other in others)]
    between = list(permutations(others, 2))
    for face, pairs in ((TOP, at_box), (BOTTOM, at_box[1:]), (LEFT, between), (BOTTOM, between), (BACK, between)):
        for first, second in pairs:
            line = squeeze(layout, placed, part, (first, second), face)
            if line is not None:
                yield [line]
    ends = [point for point in (layout.bottoms[part], layout.tops[part]) if point is not None]
    usual: list[Joint] = [attach_line(layout, placed, part, BBOX_INDEX, point, point) for point in ends]
    turning: list[Joint] = list(usual)
    for other in others:
        own, goal = layout.points(part, other)
        usual.append(attach_line(layout, placed, part, other, own, goal))
        point = _in_turning_plane(layout, part, other)
        turning.append(attach_line(layout, placed, part, other, point, point))
    yield from _sequences(usual)
    yield from _sequences(turning)


def _sequences(joints: Sequence[Joint]) -> Iterator[list[Joint]]:
    for count in range(1, MAX_ATTACHMENTS + 1):
        for chosen in permutations(joints[:MAX_CONTACTS_TRIED], count):
            yield list(chosen)


def _in_turning_plane(layout: NodeLayout, part: int, other: int) -> FloatArray:
    """Return the point of a contact about which the part turns without rolling.

    It is nearest to the plane through the part's centre perpendicular to the axis of its tilt.
    """
    box = layout.parts[part].box
    region = layout.contacts[min(part, other), max(part, other)].region
    axes = box.axes
    axis = np.array([axes[1, 2] - axes[2, 1], axes[2, 0] - axes[0, 2], axes[0, 1] - axes[1, 0]])
    axis /= max(float(np.linalg.norm(axis)), 1e-12)
    away = np.abs((region - box.center) @ axis)
    near = region[away <= away.min() + 1e-3 * layout.diagonal]
    point: FloatArray = near.mean(axis=0)
    return point


def _executed(
    layout: NodeLayout, part: int, lines: list[Joint], candidates: Sequence[list[Joint]], placed: PlacedBoxes
) -> list[Box]:
    """Return the box that each candidate after `lines` makes of a part, with numbers as printed."""
    x, y, z = layout.bbox.size.tolist()
    declared = sorted(index for index in (*placed, part) if index != BBOX_INDEX)
    cuboids = [declaration_of(layout, index) for index in declared]
    bbox = Cuboid(BBOX_NAME, (x, y, z), True)
    programs = [
        AssemblyProgram((Block("Program_0", bbox, (*cuboids, *lines, *candidate)),)) for candidate in candidates
    ]
    executions = execute_all([rounded_program(program) for program in programs])
    return [execution_boxes(execution)[declared.index(part)] for execution in executions]
