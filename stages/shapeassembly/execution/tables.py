"""Flat tables of programs for the compiled interpreter, with names resolved."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shapeassembly.syntax.errors import ProgramError
from stages.shapeassembly.syntax.limits import MAX_LINES, MAX_PARTS, MIN_DECLARED_SIZE
from stages.shapeassembly.syntax.printer import print_line
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

IndexArray = np.ndarray
"""int64."""

DECLARE, ATTACH, SQUEEZE, REFLECT, TRANSLATE = range(5)

_AXIS = {axis: index for index, axis in enumerate(AXES)}
_FACE = {face: index for index, face in enumerate(FACES)}


@dataclass(frozen=True)
class ProgramTables:
    """One program or several.

    rows: float64 (r, 10), a line each, bounding boxes included. Column 0 is the command; then, by command,
        DECLARE: assembly that expands it or -1, aligned, -, l, h, w
        ATTACH: moved, target, -, source 3, goal 3
        SQUEEZE: moved, first, second, face, u, v
        REFLECT: moved, axis
        TRANSLATE: moved, axis, copies, distance
        Cuboids are counted within their assembly, the bounding box as 0, copies where they arise; assemblies within
        their program.
    block_rows, block_parts: int64 (b + 1,), where the rows and the cuboids of each assembly start.
    program_blocks: int64 (p + 1,), where the assemblies of each program start.
    names: of each assembly the names of its cuboids, the bounding box first.
    originals: the names of what these are copies of, or their own.
    """

    rows: FloatArray
    block_rows: IndexArray
    block_parts: IndexArray
    program_blocks: IndexArray
    names: tuple[tuple[str, ...], ...]
    originals: tuple[tuple[str, ...], ...]


def program_tables(programs: Sequence[AssemblyProgram]) -> ProgramTables:
    """Return the tables of programs.

    A copy is named `cubeN`, where N is the number of cuboids before it without the bounding box, as the published
    programs expect; a taken name is skipped. Raises ProgramError where a name is unknown or taken, a cuboid is attached
    to itself, the bounding box is moved, a size is not positive, or there are too many cuboids.
    """
    rows: list[float] = []
    block_rows, block_parts, program_blocks = [0], [0], [0]
    names, originals = [], []
    for program in programs:
        assemblies = {block.name: index for index, block in enumerate(program.blocks)}
        for block in program.blocks:
            slots, block_originals = _append_block(block, assemblies, rows)
            names.append(tuple(slots))
            originals.append(block_originals)
            block_rows.append(len(rows) // 10)
            block_parts.append(block_parts[-1] + len(slots))
        program_blocks.append(len(names))
    return ProgramTables(
        rows=np.array(rows, dtype=np.float64).reshape(-1, 10),
        block_rows=np.array(block_rows),
        block_parts=np.array(block_parts),
        program_blocks=np.array(program_blocks),
        names=tuple(names),
        originals=tuple(originals),
    )


def _append_block(
    block: Block, assemblies: dict[str, int], rows: list[float]
) -> tuple[dict[str, int], tuple[str, ...]]:
    """Append the rows of one assembly. Returns its cuboids by name, and the original of each."""
    slots: dict[str, int] = {}
    originals: list[str] = []
    if len(block.lines) > MAX_LINES:
        raise ProgramError(
            "too many lines", f"{block.name} has {len(block.lines)}; an assembly has at most {MAX_LINES}"
        )
    for line in (block.bbox, *block.lines):
        try:
            if isinstance(line, Attach):
                moved, target = slots[line.moved], slots[line.target]
                if moved == target or moved == 0:
                    raise _line_error(block, line, slots)
                rows += (ATTACH, moved, target, 0, *line.source, *line.goal)
            elif isinstance(line, Cuboid):
                if line.name in slots or min(line.dims) < MIN_DECLARED_SIZE:
                    raise _line_error(block, line, slots)
                expanded_by = assemblies.get(line.name, -1) if slots else -1
                slots[line.name] = len(slots)
                originals.append(line.name)
                rows += (DECLARE, expanded_by, line.aligned, 0, *line.dims, 0, 0, 0)
            elif isinstance(line, Squeeze):
                moved, first, second = slots[line.moved], slots[line.first], slots[line.second]
                if moved in (0, first, second):
                    raise _line_error(block, line, slots)
                rows += (SQUEEZE, moved, first, second, _FACE[line.face], line.u, line.v, 0, 0, 0)
            else:
                moved = slots[line.moved]
                if moved == 0:
                    raise _line_error(block, line, slots)
                if isinstance(line, Reflect):
                    rows += (REFLECT, moved, _AXIS[line.axis], 0, 0, 0, 0, 0, 0, 0)
                    copies = 1
                else:
                    if not 1 <= line.copies <= MAX_PARTS - len(slots):
                        raise ProgramError("too many cuboids", f"{_where(block, line)}; at most {MAX_PARTS} are made")
                    rows += (TRANSLATE, moved, _AXIS[line.axis], line.copies, line.distance, 0, 0, 0, 0, 0)
                    copies = line.copies
                for _ in range(copies):
                    slots[next_copy_name(slots)] = len(slots)
                    originals.append(originals[moved])
        except KeyError as missing:
            detail = f"{_where(block, line)}: no line before it makes {missing.args[0]!r}"
            raise ProgramError("unknown name", detail) from None
    return slots, tuple(originals)


def next_copy_name(slots: Mapping[str, int]) -> str:
    """Return the name of the next copy; `slots` holds all cuboids so far, bounding box included."""
    number = len(slots) - 1
    while f"cube{number}" in slots:
        number += 1
    return f"cube{number}"


def _where(block: Block, line: Line) -> str:
    return f"{block.name}, {print_line(line)}"


def _line_error(block: Block, line: Line, slots: dict[str, int]) -> ProgramError:
    """Return the error of a line that cannot be executed."""
    if isinstance(line, Cuboid):
        if line.name in slots:
            return ProgramError("name taken", f"{_where(block, line)}: {line.name!r} is taken; rename one")
        return ProgramError("size", f"{_where(block, line)}: every size must be at least {MIN_DECLARED_SIZE:g}")
    if line.moved == BBOX:
        return ProgramError("bounding box moved", f"{_where(block, line)}: attach other cuboids to it instead")
    return ProgramError("attached to itself", f"{_where(block, line)}: name two different cuboids")
