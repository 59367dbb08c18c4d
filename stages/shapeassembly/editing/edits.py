"""Continuous edits of a program (shapeassembly figure 8): other sizes and points of attachment, the same structure."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shapeassembly.execution.parameters import MIN_CUBOID_SIZE
from stages.shapeassembly.syntax.printer import rounded_program
from stages.shapeassembly.syntax.program import AssemblyProgram, Attach, Cuboid, Line, Point, Squeeze

MAX_EXPONENT_CHANGE = 0.6
"""Exponents stay near 1, so that sizes and points keep their order and do not collapse."""


def edit_program(program: AssemblyProgram, log_std: float, rng: np.random.Generator) -> AssemblyProgram:
    """Return the program with other numbers, to three decimals; structure, copies and distances stay.

    Along each axis the whole is scaled by a random factor, and smaller sizes follow one power law, so that equal sizes
    stay equal and nested ones nested. Points of attachment do likewise between the middle of a cuboid and its sides.
    log_std: standard deviation of the logarithm of factors, and of twice the exponents.
    """
    whole = np.array(program.root.bbox.dims)
    factors = np.exp(rng.normal(0.0, log_std, 3))
    size_exponents, exponents = (
        1.0 + np.clip(rng.normal(0.0, log_std / 2, 3), -MAX_EXPONENT_CHANGE, MAX_EXPONENT_CHANGE) for _ in range(2)
    )

    def sized(dims: Point) -> Point:
        # Sizes beyond the whole scale with it.
        shares = np.array(dims) / whole
        new = whole * factors * np.where(shares < 1, shares**size_exponents, shares)
        return _point(np.maximum(new, MIN_CUBOID_SIZE))

    def placed(point: Point) -> Point:
        return _point(_warped(np.array(point), exponents))

    def change(line: Line) -> Line:
        if isinstance(line, Cuboid):
            return replace(line, dims=sized(line.dims))
        if isinstance(line, Attach):
            return replace(line, source=placed(line.source), goal=placed(line.goal))
        if isinstance(line, Squeeze):
            u, v = _warped(np.array([line.u, line.v]), exponents[0]).tolist()
            return replace(line, u=u, v=v)
        return line

    return rounded_program(program.with_lines(change))


def _warped(coordinates: FloatArray, exponents: FloatArray) -> FloatArray:
    """Move coordinates in [0, 1] towards the middle or away from it; others stay."""
    offset = 2.0 * coordinates - 1.0
    moved: FloatArray = 0.5 + 0.5 * np.sign(offset) * np.abs(offset) ** exponents
    return np.where(np.abs(offset) < 1, moved, coordinates)


def _point(numbers: FloatArray) -> Point:
    x, y, z = numbers.tolist()
    return x, y, z
