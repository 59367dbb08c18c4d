"""The continuous parameters of a program as one vector, and their ranges (shapeassembly table 1, App. D)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shapeassembly.execution.tables import ATTACH, DECLARE, REFLECT, SQUEEZE, TRANSLATE, IndexArray
from stages.shapeassembly.syntax.program import AssemblyProgram, Attach, Block, Cuboid, Line, Reflect, Squeeze

MIN_CUBOID_SIZE = 0.01
"""Smallest size of a cuboid that a model or a fit may choose (shapeassembly App. D)."""

_FIRST = {DECLARE: 4, ATTACH: 4, SQUEEZE: 5, TRANSLATE: 4, REFLECT: 4}
_COUNT = {DECLARE: 3, ATTACH: 6, SQUEEZE: 2, TRANSLATE: 1, REFLECT: 0}


def parameters(program: AssemblyProgram) -> FloatArray:
    """All continuous parameters in the order of the text, float64 (k,): three a cuboid, bounding boxes included, six an
    attach, two a squeeze, one a translate."""
    return np.array([number for block in program.blocks for line in _lines(block) for number in _numbers(line)])


def with_parameters(program: AssemblyProgram, values: FloatArray) -> AssemblyProgram:
    """The program with other parameters, in the order of `parameters`. Raises ValueError for a wrong count."""
    rest = iter(np.asarray(values, dtype=np.float64).tolist())
    changed = program.with_lines(lambda line: _with_numbers(line, rest))
    if next(rest, None) is not None:
        raise ValueError(
            f"{len(values)} values are more than the parameters of the program, {len(parameters(program))}"
        )
    return changed


def parameter_ranges(program: AssemblyProgram) -> tuple[FloatArray, FloatArray]:
    """Lowest and highest value of each parameter, float64 (k,) each; the program's own values lie between.

    Coordinates and distances lie in [0, 1]; a size is from SMALLEST to that of the root's bounding box, which itself
    stays as it is, since it says how large the whole is.
    """
    whole = program.root.bbox
    low, high = [], []
    for block in program.blocks:
        for line in _lines(block):
            numbers = _numbers(line)
            least, most = [0.0] * len(numbers), [1.0] * len(numbers)
            if isinstance(line, Cuboid):
                least, most = [MIN_CUBOID_SIZE] * 3, list(whole.dims)
            if line is whole:
                least = most = numbers
            low += [min(bound, number) for bound, number in zip(least, numbers, strict=True)]
            high += [max(bound, number) for bound, number in zip(most, numbers, strict=True)]
    return np.array(low), np.array(high)


def parameter_places(rows: FloatArray) -> IndexArray:
    """Where the parameters stand in the rows of a Flat, int64 (k, 2)."""
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
