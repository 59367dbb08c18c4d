"""What a well-made program keeps to, beyond what can be executed (shapeassembly table 1, §6.2 and App. D)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from stages.shapeassembly.execution.interpreter import Execution, execute_block
from stages.shapeassembly.execution.parameters import MIN_CUBOID_SIZE
from stages.shapeassembly.execution.tables import next_copy_name
from stages.shapeassembly.syntax.printer import print_line
from stages.shapeassembly.syntax.program import (
    BBOX,
    AssemblyProgram,
    Attach,
    Block,
    Cuboid,
    Line,
    Reflect,
    Squeeze,
    Translate,
)

Rule = Literal[
    "name taken",
    "unknown name",
    "circle",
    "assembly unused",
    "order of lines",
    "bounding box not aligned",
    "bounding box moved",
    "bounding box at its sides",
    "attached to itself",
    "attached twice",
    "not grounded",
    "size",
    "range",
    "too many cuboids",
]
RULE_NAMES: tuple[Rule, ...] = get_args(Rule)

MAX_CUBOIDS = 10
"""Cuboids that an assembly declares (shapeassembly §6.1)."""

BBOX_END_SHARE = 0.05
"""How far from the top or bottom of the bounding box an attachment to it may be, as a share of its height."""

MAX_EXCESS_SHARE = 0.1
"""By how much a cuboid may be larger than the bounding box, as a share."""

_STEPS = {Cuboid: 0, Attach: 1, Squeeze: 1, Reflect: 2, Translate: 2}


@dataclass(frozen=True)
class Violation:
    """A rule that a line breaks. number: of the line in the canonical text, from 1; 0 where it is no one line."""

    rule: Rule
    number: int
    detail: str

    def __str__(self) -> str:
        return f"line {self.number}: {self.rule}: {self.detail}" if self.number else f"{self.rule}: {self.detail}"


def violations(program: AssemblyProgram) -> list[Violation]:
    """Every rule that the program breaks, in the order of its lines; empty for a well-made program."""
    found: list[Violation] = []
    number = 1
    for block in program.blocks:
        found += _Checker(block, number + 1).violations()
        number += len(block.lines) + 3
    return [*found, *_tree_violations(program)]


def overflow(program: AssemblyProgram, execution: Execution) -> float:
    """How far the executed cuboids reach out of the root's bounding box, as a share of its size along that axis."""
    if not len(execution):
        return 0.0
    reach = np.abs(execution.corners).max(axis=(0, 1)) / program.root.bbox.dims
    return max(0.0, float(reach.max()) - 0.5)


def protruding_parts(block: Block) -> list[str]:
    """The cuboids and copies of one assembly that reach out of its bounding box by more than LARGER of its size along
    an axis (shapeassembly App. D), by name, in the order of the lines. Raises ProgramError where the assembly by itself
    cannot be executed."""
    names, boxes = execute_block(block)
    frames = boxes[:, 6:].reshape(-1, 3, 3)
    reach = np.abs(boxes[:, :3]) + np.einsum("nk,nkc->nc", boxes[:, 3:6] / 2, np.abs(frames))
    beyond = (reach > (0.5 + MAX_EXCESS_SHARE) * np.array(block.bbox.dims) + 1e-9).any(axis=1)
    return [names[place] for place in np.flatnonzero(beyond).tolist()]


def _tree_violations(program: AssemblyProgram) -> Iterator[Violation]:
    """Assemblies that no cuboid stands for, and those that stand within themselves."""
    below = {
        block.name: [each.name for each in block.cuboids if each.name in program.named] for block in program.blocks
    }
    reached, ahead = {program.root.name}, [program.root.name]
    while ahead:
        more = [name for name in below[ahead.pop()] if name not in reached]
        reached.update(more)
        ahead += more
    for name in below:
        if name not in reached:
            yield Violation("assembly unused", 0, f"no cuboid of the program is named {name!r}")
    # What is left when assemblies whose cuboids all end have been taken away stands in a circle.
    left = dict(below)
    while ending := [name for name, names in left.items() if not any(each in left for each in names)]:
        for name in ending:
            del left[name]
    if left:
        yield Violation("circle", 0, f"these assemblies have no end: {', '.join(left)}")


class _Checker:
    """Goes through the lines of one assembly."""

    def __init__(self, block: Block, number: int) -> None:
        self.block = block
        self.number = number
        self.places = {BBOX: 0}
        self.grounded = {BBOX}
        self.joined: set[tuple[str, str, str]] = set()
        self.found: list[Violation] = []

    def violations(self) -> list[Violation]:
        block = self.block
        if not block.bbox.aligned:
            self.add("bounding box not aligned", block.bbox, "write True")
        if min(block.bbox.dims) < MIN_CUBOID_SIZE:
            self.add("size", block.bbox, f"every size must be at least {MIN_CUBOID_SIZE}")
        step = 0
        for line in block.lines:
            self.number += 1
            if _STEPS[type(line)] < step:
                self.add("order of lines", line, "cuboids come first, then attach and squeeze, then reflect, translate")
            step = max(step, _STEPS[type(line)])
            if isinstance(line, Cuboid):
                self.cuboid(line)
            else:
                self.command(line)
        self.number = 0
        for cuboid in block.cuboids:
            if cuboid.name not in self.grounded:
                self.add("not grounded", cuboid, f"no line of {block.name} attaches it")
        if len(block.cuboids) > MAX_CUBOIDS:
            self.add("too many cuboids", block.bbox, f"{block.name} has {len(block.cuboids)}, of {MAX_CUBOIDS} at most")
        return self.found

    def add(self, rule: Rule, line: Line, detail: str) -> None:
        self.found.append(Violation(rule, self.number, f"{print_line(line)}: {detail}"))

    def cuboid(self, line: Cuboid) -> None:
        if line.name in self.places:
            self.add("name taken", line, f"{line.name!r} is there already")
        self.places[line.name] = len(self.places)
        whole = self.block.bbox.dims
        if any(
            not MIN_CUBOID_SIZE <= size <= (1 + MAX_EXCESS_SHARE) * most
            for size, most in zip(line.dims, whole, strict=True)
        ):
            self.add("size", line, f"sizes are from {MIN_CUBOID_SIZE} to those of the bounding box, {whole}")

    def command(self, line: Attach | Squeeze | Reflect | Translate) -> None:
        names = {line.moved: None}
        if isinstance(line, Attach):
            names[line.target] = None
        elif isinstance(line, Squeeze):
            names |= {line.first: None, line.second: None}
        for name in names:
            if name not in self.places:
                self.add("unknown name", line, f"no line before it makes {name!r}")
        if line.moved == BBOX:
            self.add("bounding box moved", line, "attach other cuboids to it instead")
        if isinstance(line, Reflect | Translate):
            self.copies(line)
        elif isinstance(line, Attach):
            self.in_range(line, *line.source, *line.goal)
            top = line.goal[1] > 0.5
            if line.target == BBOX and BBOX_END_SHARE < line.goal[1] < 1 - BBOX_END_SHARE:
                self.add("bounding box at its sides", line, f"y must be within {BBOX_END_SHARE} of 0 or 1")
            self.attached(line, line.target, "top" if top else "bot")
        else:
            self.in_range(line, line.u, line.v)
            if BBOX in (line.first, line.second) and line.face not in ("top", "bot"):
                self.add("bounding box at its sides", line, "towards the bounding box the face is top or bot")
            self.attached(line, line.first, line.face)
            self.attached(line, line.second, "bot" if line.face == "top" else "top")

    def in_range(self, line: Line, *numbers: float) -> None:
        if any(not 0 <= number <= 1 for number in numbers):
            self.add("range", line, "coordinates are from 0 to 1")

    def attached(self, line: Attach | Squeeze, target: str, side: str) -> None:
        if target == line.moved:
            self.add("attached to itself", line, "name two different cuboids")
        if target not in self.grounded and target in self.places:
            self.add("not grounded", line, f"{target!r} must be attached itself before")
        # To the bounding box a cuboid may be attached at its top and at its bottom.
        joint = (line.moved, target, side if target == BBOX else "")
        if joint in self.joined:
            self.add("attached twice", line, f"{line.moved!r} is attached to {target!r} already")
        self.joined.add(joint)
        self.grounded.add(line.moved)

    def copies(self, line: Reflect | Translate) -> None:
        if line.moved not in self.grounded and line.moved in self.places:
            self.add("not grounded", line, f"{line.moved!r} must be attached before it is copied")
        if isinstance(line, Translate):
            self.in_range(line, line.distance)
        for _ in range(1 if isinstance(line, Reflect) else line.copies):
            name = next_copy_name(self.places)
            self.places[name] = len(self.places)
            self.grounded.add(name)
