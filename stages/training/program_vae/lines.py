"""Lines of ShapeAssembly programs as 63 numbers each (shapeassembly §6.1)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from stages.shape.arrays import FloatArray
from stages.shapeassembly.syntax.errors import ProgramError
from stages.shapeassembly.syntax.program import (
    AXES,
    BBOX,
    FACES,
    AssemblyProgram,
    Attach,
    Block,
    Cuboid,
    Line,
    Reflect,
    Squeeze,
)

START, STOP, CUBOID, ATTACH, SQUEEZE, TRANSLATE, REFLECT = range(7)
Rows = npt.NDArray[np.float32]

SLOT_COUNT = 11
"""Cuboids that a line may name: the bounding box, and ten in the order of their declarations."""

COMMAND, INDICES = slice(0, 7), slice(7, 40)
DIMS, POINTS, AXIS, COPIES, FACE, UV, ALIGNED = (
    slice(40, 43), slice(43, 49), slice(49, 52), slice(52, 54), slice(54, 60), slice(60, 62), slice(62, 63),
)  # fmt: skip
LINE_WIDTH = 63
COPIES_UNIT = 10.0
"""Divisor of copy counts, so that they are of the order of the other numbers."""


@dataclass(frozen=True)
class AssemblyLines:
    """One assembly, without the line of its bounding box.

    numbers: float32 (lines + 1, 63), the last line is STOP.
    children: int64 (lines + 1,), the assembly that expands the line's cuboid, counted breadth first, or -1.
    box: float64 (3,), sizes of the bounding box.
    parent, line: the assembly and line that it expands, -1 for the root.
    """

    numbers: Rows
    children: np.ndarray
    box: FloatArray
    parent: int
    line: int


def assembly_lines(program: AssemblyProgram) -> list[AssemblyLines]:
    """Return the assemblies of a program, breadth first.

    Raises ProgramError where an assembly has more than ten cuboids, names a cuboid that no line declares, such as a
    copy, or is expanded twice.
    """
    assemblies: list[AssemblyLines] = []
    queue = [(program.root, -1, -1)]
    seen = {program.root.name}
    for number, (block, parent, line) in enumerate(queue):
        children = np.full(len(block.lines) + 1, -1)
        for index, statement in enumerate(block.lines):
            below = program.named.get(statement.name) if isinstance(statement, Cuboid) else None
            if below is not None:
                if below.name in seen:
                    raise ProgramError("expanded twice", f"{below.name} stands for two cuboids; give each its own")
                seen.add(below.name)
                children[index] = len(queue)
                queue.append((below, number, index))
        assemblies.append(AssemblyLines(_numbers(block), children, np.array(block.bbox.dims), parent, line))
    return assemblies


def _numbers(block: Block) -> Rows:
    slots = {name: slot for slot, name in enumerate([BBOX, *(cuboid.name for cuboid in block.cuboids)])}
    if len(slots) > SLOT_COUNT:
        raise ProgramError(
            "too many cuboids", f"{block.name} has {len(slots) - 1}, at most {SLOT_COUNT - 1} are learnt"
        )
    numbers = np.zeros((len(block.lines) + 1, LINE_WIDTH), np.float32)
    for row, line in zip(numbers, block.lines, strict=False):
        for position, name in enumerate(_named(line)):
            if name not in slots:
                raise ProgramError("names a copy", f"{block.name}: {name!r} is made by no Cuboid line")
            row[INDICES.start + SLOT_COUNT * position + slots[name]] = 1
        _fill(row, line)
    numbers[-1, STOP] = 1
    return numbers


def _named(line: Line) -> Iterator[str]:
    if isinstance(line, Cuboid):
        return
    yield line.moved
    if isinstance(line, Attach):
        yield line.target
    elif isinstance(line, Squeeze):
        yield from (line.first, line.second)


def _fill(row: Rows, line: Line) -> None:
    if isinstance(line, Cuboid):
        row[CUBOID], row[DIMS], row[ALIGNED] = 1, line.dims, line.aligned
    elif isinstance(line, Attach):
        row[ATTACH], row[POINTS] = 1, (*line.source, *line.goal)
    elif isinstance(line, Squeeze):
        row[SQUEEZE], row[UV] = 1, (line.u, line.v)
        row[FACE.start + FACES.index(line.face)] = 1
    elif isinstance(line, Reflect):
        row[REFLECT] = row[AXIS.start + AXES.index(line.axis)] = 1
    else:
        row[TRANSLATE] = row[AXIS.start + AXES.index(line.axis)] = 1
        row[COPIES] = (line.copies / COPIES_UNIT, line.distance)
