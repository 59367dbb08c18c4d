"""Rules of well-formed programs, beyond what can be executed (shapeassembly table 1, §6.2 and App. D)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

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

MAX_CUBOIDS = 10
"""Cuboids that an assembly declares (shapeassembly §6.1)."""

BBOX_END_SHARE = 0.05
"""Attachments to the bounding box are this close to its top or bottom, as a share of its height."""

MAX_EXCESS_SHARE = 0.1
"""Maximum excess of a cuboid over the bounding box."""

_STEPS = {Cuboid: 0, Attach: 1, Squeeze: 1, Reflect: 2, Translate: 2}


@dataclass(frozen=True)
class Violation:
    """A rule that a line breaks.

    number: of the line in the canonical text, from 1; 0 where it is no single line.
    """

    rule: Rule
    number: int
    detail: str

    def __str__(self) -> str:
        return f"line {self.number}: {self.rule}: {self.detail}" if self.number else f"{self.rule}: {self.detail}"


def violations(program: AssemblyProgram) -> list[Violation]:
    """Return every broken rule in the order of the lines; empty for a well-formed program."""
    broken: list[Violation] = []
    number = 1
    for block in program.blocks:
        broken += _Checker(block, number + 1).violations()
        number += len(block.lines) + 3
    return [*broken, *_tree_violations(program)]


def overflow(program: AssemblyProgram, execution: Execution) -> float:
    """Return the maximum excess of executed cuboids over the root's bounding box, as a share of its size."""
    if not len(execution):
        return 0.0
    reach = np.abs(execution.corners).max(axis=(0, 1)) / program.root.bbox.dims
    return max(0.0, float(reach.max()) - 0.5)


def protruding_parts(block: Block) -> list[str]:
    """Return the cuboids and copies of an assembly that reach out of its bounding box (shapeassembly App. D), by name.

    The limit is MAX_EXCESS_SHARE of the size along an axis. Raises ProgramError where the assembly cannot be executed.
    """
    names, boxes = execute_block(block)
    frames = boxes[:, 6:].reshape(-1, 3, 3)
    reach = np.abs(boxes[:, :3]) + np.einsum("nk,nkc->nc", boxes[:, 3:6] / 2, np.abs(frames))
    protruding = (reach > (0.5 + MAX_EXCESS_SHARE) * np.array(block.bbox.dims) + 1e-9).any(axis=1)
    return [names[index] for index in np.flatnonzero(protruding).tolist()]


def _tree_violations(program: AssemblyProgram) -> Iterator[Violation]:
    """Yield assemblies that no cuboid names, and those that contain themselves."""
    below = {
        block.name: [cuboid.name for cuboid in block.cuboids if cuboid.name in program.named]
        for block in program.blocks
    }
    reached, pending = {program.root.name}, [program.root.name]
    while pending:
        more = [name for name in below[pending.pop()] if name not in reached]
        reached.update(more)
        pending += more
    for name in below:
        if name not in reached:
            yield Violation("assembly unused", 0, f"no cuboid of the program is named {name!r}")
    # What remains after repeatedly removing assemblies without open children is a circle.
    left = dict(below)
    while ending := [name for name, names in left.items() if not any(name in left for name in names)]:
        for name in ending:
            del left[name]
    if left:
        yield Violation("circle", 0, f"these assemblies have no end: {', '.join(left)}")


class _Checker:
    """Checks the lines of one assembly."""

    def __init__(self, block: Block, number: int) -> None:
        self.block = block
        self.number = number
        self.slots = {BBOX: 0}
        self.grounded = {BBOX}
        self.joined: set[tuple[str, str, str]] = set()
        self.broken: list[Violation] = []

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
        return self.broken

    def add(self, rule: Rule, line: Line, detail: str) -> None:
        self.broken.append(Violation(rule, self.number, f"{print_line(line)}: {detail}"))

    def cuboid(self, line: Cuboid) -> None:
        if line.name in self.slots:
            self.add("name taken", line, f"{line.name!r} is there already")
        self.slots[line.name] = len(self.slots)
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
            if name not in self.slots:
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
        if target not in self.grounded and target in self.slots:
            self.add("not grounded", line, f"{target!r} must be attached itself before")
        # A cuboid may be attached to the top and to the bottom of the bounding box.
        joint = (line.moved, target, side if target == BBOX else "")
        if joint in self.joined:
            self.add("attached twice", line, f"{line.moved!r} is attached to {target!r} already")
        self.joined.add(joint)
        self.grounded.add(line.moved)

    def copies(self, line: Reflect | Translate) -> None:
        if line.moved not in self.grounded and line.moved in self.slots:
            self.add("not grounded", line, f"{line.moved!r} must be attached before it is copied")
        if isinstance(line, Translate):
            self.in_range(line, line.distance)
        for _ in range(1 if isinstance(line, Reflect) else line.copies):
            name = next_copy_name(self.slots)
            self.slots[name] = len(self.slots)
            self.grounded.add(name)
