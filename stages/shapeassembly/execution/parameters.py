"""The continuous parameters of a program as one vector, and their ranges (shapeassembly table 1, App. D)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shapeassembly.execution.tables import ATTACH, DECLARE, REFLECT, SQUEEZE, TRANSLATE, IndexArray
from stages.shapeassembly.syntax.program import AssemblyProgram, Attach, Block, Cuboid, Line, Reflect, Squeeze

MIN_CUBOID_SIZE = 0.01
"""Minimum size of a cuboid that a model or a fit may choose (shapeassembly App. D)."""

_FIRST = {DECLARE: 4, ATTACH: 4, SQUEEZE: 5, TRANSLATE: 4, REFLECT: 4}
_COUNT = {DECLARE: 3, ATTACH: 6, SQUEEZE: 2, TRANSLATE: 1, REFLECT: 0}


def parameters(program: AssemblyProgram) -> FloatArray:
    """Return all continuous parameters in the order of the text, float64 (k,).

    A cuboid, bounding boxes included, has three, an attach six, a squeeze two, a translate one.
    """
    return np.array([number for block in program.blocks for line in _lines(block) for number in _numbers(line)])


def with_parameters(program: AssemblyProgram, values: FloatArray) -> AssemblyProgram:
    """Return the program with other parameters, ordered as `parameters`. Raises ValueError for a wrong count."""
    rest = iter(np.asarray(values, dtype=np.float64).tolist())
    changed = program.with_lines(lambda line: _with_numbers(line, rest))
    if next(rest, None) is not None:
        raise ValueError(
            f"{len(values)} values are more than the parameters of the program, {len(parameters(program))}"
        )
    return changed


def parameter_ranges(program: AssemblyProgram) -> tuple[FloatArray, FloatArray]:
    """Return minimum and maximum of each parameter, float64 (k,) each; they include the program's own values.

    Coordinates and distances are in [0, 1]; sizes from MIN_CUBOID_SIZE to those of the root's bounding box, which is
    fixed, since it defines the scale.
    """
    whole = program.root.bbox
    low, high = [], []
    for block in program.blocks:
        for line in _lines(block):
            numbers = _numbers(line)
            lower, upper = [0.0] * len(numbers), [1.0] * len(numbers)
            if isinstance(line, Cuboid):
                lower, upper = [MIN_CUBOID_SIZE] * 3, list(whole.dims)
            if line is whole:
                lower = upper = numbers
            low += [min(bound, number) for bound, number in zip(lower, numbers, strict=True)]
            high += [max(bound, number) for bound, number in zip(upper, numbers, strict=True)]
    return np.array(low), np.array(high)


def parameter_places(rows: FloatArray) -> IndexArray:
    """Return the row and column of each parameter in ProgramTables, int64 (k, 2)."""
    places = [
        (row, column)
        for row, kind in enumerate(rows[:, 0].astype(int).tolist())
        for column in range(_FIRST[kind], _FIRST[kind] + _COUNT[kind])
    ]
    return np.array(places, dtype=np.int64)


def _lines(block: Block) -> tuple[Line, ...]:
    return (block.bbox, *block.lines)


def _numbers(line: Line) -> list[float]:
    if isinstance(line, Cuboid):
        return list(line.dims)
    if isinstance(line, Attach):
        return [*line.source, *line.goal]
    if isinstance(line, Squeeze):
        return [line.u, line.v]
    return [] if isinstance(line, Reflect) else [line.distance]


def _with_numbers(line: Line, rest: Iterator[float]) -> Line:
    try:
        if isinstance(line, Cuboid):
            return replace(line, dims=(next(rest), next(rest), next(rest)))
        if isinstance(line, Attach):
            source = (next(rest), next(rest), next(rest))
            return replace(line, source=source, goal=(next(rest), next(rest), next(rest)))
        if isinstance(line, Squeeze):
            return replace(line, u=next(rest), v=next(rest))
        return line if isinstance(line, Reflect) else replace(line, distance=next(rest))
    except StopIteration:
        raise ValueError("fewer values than the program has parameters") from None
