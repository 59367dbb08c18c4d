"""Continuous edits: other numbers, the same structure, and what was equal or at an end stays so."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from stages.shapeassembly import execute, parse
from stages.shapeassembly.analysis.structure import signature
from stages.shapeassembly.editing.edits import edit_program
from stages.shapeassembly.syntax.printer import print_program
from stages.shapeassembly.syntax.program import AssemblyProgram, Attach, Cuboid, Squeeze
from tests.stages.shapeassembly.strategies import programs


def numbers(program: AssemblyProgram) -> list[tuple[float, ...]]:
    """Sizes and places of all lines in order; none of what an edit must leave alone."""
    found: list[tuple[float, ...]] = []
    for block in program.blocks:
        for line in (block.bbox, *block.lines):
            if isinstance(line, Cuboid):
                found.append(line.dims)
            elif isinstance(line, Attach):
                found.append((*line.source, *line.goal))
            elif isinstance(line, Squeeze):
                found.append((line.u, line.v))
    return found


@given(programs(), st.integers(0, 99))
def test_edit_keeps_the_structure(program: AssemblyProgram, seed: int) -> None:
    made = edit_program(program, 0.3, np.random.default_rng(seed))
    assert signature(made) == signature(program)
    assert parse(print_program(made)) == made
    assert edit_program(program, 0.3, np.random.default_rng(seed)) == made


@given(programs(), st.integers(0, 99))
def test_edit_keeps_the_order_of_sizes_and_the_side_of_points(program: AssemblyProgram, seed: int) -> None:
    made = edit_program(program, 0.3, np.random.default_rng(seed))

    def sizes(of: AssemblyProgram, axis: int) -> list[float]:
        return [line.dims[axis] for block in of.blocks for line in (block.bbox, *block.cuboids)]

    for axis in range(3):
        whole, new = program.root.bbox.dims[axis], made.root.bbox.dims[axis]
        inside = sorted(pair for pair in zip(sizes(program, axis), sizes(made, axis), strict=True) if pair[0] <= whole)
        for (low, small), (high, large) in pairwise(inside):
            assert small == large if low == high else small <= large
        assert inside[-1][1] == new
    for old, place in zip(numbers(program), numbers(made), strict=True):
        if len(old) == 3:
            continue
        for before, after in zip(old, place, strict=True):
            assert (after in {0.0, 0.5, 1.0}) if before in {0.0, 0.5, 1.0} else 0.0 <= after <= 1.0
            assert (after - 0.5) * (before - 0.5) >= 0


def test_larger_log_std_changes_more() -> None:
    lines = "bbox = Cuboid(1.0, 2.0, 1.0, True) a = Cuboid(0.2, 2.0, 0.3, True) squeeze(a, bbox, bbox, top, 0.3, 0.4)"
    program = parse(f"Assembly P {{ {lines} }}")

    def change(spread: float) -> float:
        made = [edit_program(program, spread, np.random.default_rng(seed)) for seed in range(50)]
        return float(np.mean([abs(np.log(item.root.bbox.dims[0])) for item in made]))

    assert 0.5 * 0.05 < change(0.05) < change(0.2) < change(0.5)
    assert len(execute(edit_program(program, 0.5, np.random.default_rng(1)))) == 1
