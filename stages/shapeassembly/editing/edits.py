"""Continuous edits of a program (shapeassembly figure 8): other sizes and places of attachment, the same structure."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shapeassembly.execution.parameters import MIN_CUBOID_SIZE
from stages.shapeassembly.syntax.printer import rounded
from stages.shapeassembly.syntax.program import AssemblyProgram, Attach, Cuboid, Line, Point, Squeeze

MAX_EXPONENT_CHANGE = 0.6
"""Largest change of an exponent: sizes and places keep their order and do not all become one."""


def edited(program: AssemblyProgram, spread: float, rng: np.random.Generator) -> AssemblyProgram:
    """The program with other numbers, to three decimals; its structure is the same, copies and distances too.

    Along each axis the whole grows by a random factor, and all sizes follow one power law below that of the whole, so
    that sizes that were equal stay equal, and what fitted in goes on fitting. Places of attachment do likewise between
    the middle of a cuboid and its sides, where they stay. spread: standard deviation of the logarithm of factors, and
    of twice the exponents.
    """
    whole = np.array(program.root.bbox.dims)
    factors = np.exp(rng.normal(0.0, spread, 3))
    sizes, places = (
        1.0 + np.clip(rng.normal(0.0, spread / 2, 3), -MAX_EXPONENT_CHANGE, MAX_EXPONENT_CHANGE) for _ in range(2)
    )

    def sized(dims: Point) -> Point:
        # What reaches out of the whole grows with it.
        shares = np.array(dims) / whole
        new = whole * factors * np.where(shares < 1, shares**sizes, shares)
        return _point(np.maximum(new, MIN_CUBOID_SIZE))

    def placed(point: Point) -> Point:
        return _point(_warped(np.array(point), places))

    def change(line: Line) -> Line:
        if isinstance(line, Cuboid):
            return replace(line, dims=sized(line.dims))
        if isinstance(line, Attach):
            return replace(line, source=placed(line.source), goal=placed(line.goal))
        if isinstance(line, Squeeze):
            u, v = _warped(np.array([line.u, line.v]), places[0]).tolist()
            return replace(line, u=u, v=v)
        return line

    return rounded(program.with_lines(change))


def _warped(places: FloatArray, exponents: FloatArray) -> FloatArray:
    """Places in [0, 1], moved towards the middle or away from it; others stay."""
    away = 2.0 * places - 1.0
    moved: FloatArray = 0.5 + 0.5 * np.sign(away) * np.abs(away) ** exponents
    return np.where(np.abs(away) < 1, moved, places)


def _point(numbers: FloatArray) -> Point:
    x, y, z = numbers.tolist()
    return x, y, z
