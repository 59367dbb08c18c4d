"""The movement of a surface by a parameter, of blocks whose distances are known."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from stages.programs.__main__ import main
from stages.programs.curves import Part, box
from stages.programs.movement import movement_table, movements
from stages.programs.parameters import binary, continuous
from stages.programs.program import Program, find_program, program_names
from tests.stages.programs.block import PROGRAM


def test_a_block_is_moved_by_half_of_what_it_grows() -> None:
    width, height = movements(PROGRAM, 40, 0)
    # There are six blocks, and each of them is looked at once.
    blocks = list(itertools.product((1.0, 2.0), (1.0, 1.5, 2.0)))
    diagonal = {size: float(np.linalg.norm([*size, 1.0])) for size in blocks}
    assert np.sort(width.far) == pytest.approx(sorted(0.5 / diagonal[size] for size in blocks), rel=1e-5)
    assert np.array_equal(width.far, width.step)
    expected = sorted((0.25 if tall == 1.5 else 0.5) / diagonal[wide, tall] for wide, tall in blocks)
    assert np.sort(height.far) == pytest.approx(expected, rel=1e-5)
    assert np.sort(height.step) == pytest.approx(sorted(0.25 / each for each in diagonal.values()), rel=1e-5)
    assert (width.seen, width.weak) == (1.0, False)


def lid(values: dict[str, float]) -> list[Part]:
    parts = [Part("chest", box((1.0, 1.0, 1.0)), (180, 120, 90))]
    if values["has_lid"]:
        parts.append(Part("lid", box((1.0, 0.004 + values["thickness"], 1.0), (0.0, 0.502, 0.0)), (180, 120, 90)))
    return parts


def test_what_is_hidden_is_not_counted_and_what_hardly_moves_is_weak() -> None:
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
    assert (thickness.seen, thickness.weak) == (0.0, True)
    assert "| `thickness` | 0% |" in movement_table([thickness])
    assert movement_table([thickness]).endswith("| weak |\n")


def test_the_command_prints_a_line_a_parameter(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["movement", "tests.stages.programs.block", "--count", "3"]) == 0
    assert [line.split(" | ")[0] for line in capsys.readouterr().out.splitlines()[2:]] == ["| `width`", "| `height`"]


@pytest.mark.slow
@pytest.mark.parametrize("name", program_names())
def test_every_parameter_of_the_library_can_be_read_from_its_shapes(name: str) -> None:
    # A few of the forty that `python -m stages.programs movement` looks at, which say that none is weak.
    found = list(movements(find_program(name), 5, 0))
    assert not [each for each in found if each.seen < 0.6], movement_table(found)
