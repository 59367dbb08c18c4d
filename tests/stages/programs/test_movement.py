"""The movement of surfaces by parameters, for blocks with known distances."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from stages.programs.curves import Part, box
from stages.programs.movement import movement_table, movements
from stages.programs.parameters import binary, continuous
from stages.programs.program import Program, find_program, program_names
from tests.command import shapemill
from tests.stages.programs.block import PROGRAM


def test_surface_moves_by_half_of_the_growth() -> None:
    width, height = movements(PROGRAM, 40, 0)
    # There are six blocks, each of them measured once.
    blocks = list(itertools.product((1.0, 2.0), (1.0, 1.5, 2.0)))
    diagonal = {size: float(np.linalg.norm([*size, 1.0])) for size in blocks}
    assert np.sort(width.far) == pytest.approx(sorted(0.5 / diagonal[size] for size in blocks), rel=1e-5)
    assert np.array_equal(width.far, width.step)
    expected = sorted((0.25 if tall == 1.5 else 0.5) / diagonal[wide, tall] for wide, tall in blocks)
    assert np.sort(height.far) == pytest.approx(expected, rel=1e-5)
    assert np.sort(height.step) == pytest.approx(sorted(0.25 / length for length in diagonal.values()), rel=1e-5)
    assert (width.visible_share, width.weak) == (1.0, False)


def lid(values: dict[str, float]) -> list[Part]:
    parts = [Part("chest", box((1.0, 1.0, 1.0)), (180, 120, 90))]
    if values["has_lid"]:
        parts.append(Part("lid", box((1.0, 0.004 + values["thickness"], 1.0), (0.0, 0.502, 0.0)), (180, 120, 90)))
    return parts


def test_hidden_parameters_do_not_count_and_faint_ones_are_weak() -> None:
    chest = Program(
        name="chest",
        description="A chest.",
        parameters=(
            continuous("thickness", 0.001, 0.003, 3, 0.001, "lid", "Of the lid.", visible_if="has_lid"),
            binary("has_lid", True, "lid", "Whether it has a lid."),
        ),
        labels=("chest", "lid"),
        build=lid,
    )
    thickness, _ = movements(chest, 40, 0)
    assert len(thickness.far) == 3
    assert thickness.far.max() < 0.002
    assert (thickness.visible_share, thickness.weak) == (0.0, True)
    assert "| `thickness` | 0% |" in movement_table([thickness])
    assert movement_table([thickness]).endswith("| weak |\n")


def test_command_prints_a_line_per_parameter() -> None:
    code, printed = shapemill("programs", "movement", "tests.stages.programs.block", "--count", 3)
    assert code == 0
    assert [line.split(" | ")[0] for line in printed.splitlines()[2:]] == ["| `width`", "| `height`"]


@pytest.mark.slow
@pytest.mark.parametrize("name", program_names())
def test_parameters_of_the_library_are_visible(name: str) -> None:
    # With the forty shapes of `shapemill programs movement`, no parameter is weak.
    measured = list(movements(find_program(name), 5, 0))
    assert not [movement for movement in measured if movement.visible_share < 0.6], movement_table(measured)
