"""What may come next in a program: real ones keep to it, and whatever keeps to it breaks no rule."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from stages.shapeassembly import execute, parse
from stages.shapeassembly.analysis.structure import signature
from stages.shapeassembly.syntax.checks import violations
from stages.shapeassembly.syntax.program import AssemblyProgram
from stages.training.program_lm.corpus import word_sequence
from stages.training.program_lm.partial_program import PartialProgram
from stages.training.program_lm.tokens import TokenField, first_word, program_words, step_values
from stages.training.program_vae.lines import ATTACH, CUBOID, REFLECT, SQUEEZE, STOP
from stages.training.program_vae.partial_assembly import MAX_DEPTH, MAX_LINES
from tests.stages.training.program_vae.test_lines import BOX, STOOL

EXAMPLES = [
    parse(path.read_text(encoding="utf-8")) for path in sorted(Path("datasets/exemplars/programs").glob("*.txt"))
]
PROGRAMS = [*EXAMPLES, parse(STOOL), parse(BOX)]
UNIT = max(max(program.root.bbox.dims) for program in PROGRAMS)
WORDED = [program_words(program, UNIT) for program in PROGRAMS]
VALUES = step_values(WORDED)


def again(number: int) -> AssemblyProgram | None:
    text = PartialProgram(VALUES, UNIT)
    for _, word, _ in WORDED[number]:
        text.take(word, fit=False)
    assert text.field is None
    return text.program()


@pytest.mark.parametrize("number", range(len(PROGRAMS)))
def test_programs_round_trip_up_to_the_steps_of_numbers(number: int) -> None:
    assert word_sequence(WORDED[number], VALUES, UNIT) is not None
    program, wanted = again(number), PROGRAMS[number]
    assert program is not None
    assert signature(program) == signature(wanted)
    away = np.abs(execute(program).corners - execute(wanted).corners).max()
    assert away < 0.05 * np.linalg.norm(wanted.root.bbox.dims)


def chance(seed: int, often: set[int]) -> AssemblyProgram | None:
    """A program of random words; commands of `often` come whenever they may, but for one time in eight."""
    rng = np.random.default_rng(seed)
    text = PartialProgram(VALUES, UNIT)
    for _ in range(20_000):
        if text.field is None:
            return text.program()
        places = np.flatnonzero(text.allowed())
        if text.field == TokenField.COMMAND and often & set(places.tolist()) and rng.random() < 0.875:
            places = np.array(sorted(often & set(places.tolist())))
        if text.field == TokenField.BUILD and rng.random() < 0.8:
            places = places[:2]
        text.take(int(rng.choice(places)), fit=False)
    raise AssertionError("no end")


@pytest.mark.parametrize("often", [set(), {ATTACH, SQUEEZE}, {CUBOID}, {REFLECT}])
def test_random_allowed_words_give_finished_valid_programs(often: set[int]) -> None:
    lines = 0
    for seed in range(12):
        program = chance(seed, often)
        if program is not None:
            assert violations(program) == []
            assert max(len(block.lines) for block in program.blocks) <= MAX_LINES
            assert len(program.blocks) == 1 or program.root.cuboids
            lines += len(program.root.lines)
    assert lines > 12


def said(text: PartialProgram, *places: int) -> None:
    """Write words, by their place among those of their field."""
    for place in places:
        field = text.field
        assert field is not None
        word = first_word(field) + place
        assert text.allowed()[word], (field, place)
        text.take(word, fit=False)


def may(text: PartialProgram) -> set[int]:
    field = text.field
    assert field is not None
    return set((np.flatnonzero(text.allowed()) - first_word(field)).tolist())


def test_grammar_orders_lines_and_attaches_every_cuboid_once() -> None:
    text = PartialProgram(VALUES, UNIT)
    said(text, 30, 30, 30)
    assert may(text) == {CUBOID}
    said(text, CUBOID, 20, 20, 20, 1, CUBOID, 20, 20, 20)
    assert text.cue[1] == 2, "the line is about the second cuboid"
    said(text, 0)
    assert may(text) == {CUBOID, ATTACH, SQUEEZE}
    said(text, ATTACH)
    assert may(text) == {1, 2}
    said(text, 1)
    assert may(text) == {0}, "the other is not grounded"
    said(text, 0, 32, 0, 32, 32)
    ends = VALUES[TokenField.GOAL_Y][sorted(may(text))]
    assert ((ends <= 0.05) | (ends >= 0.95)).all()
    assert len(set(ends > 0.5)) == 2
    said(text, 0, 32)
    assert may(text) == {ATTACH, SQUEEZE}, "the other must be attached"
    said(text, ATTACH, 2)
    assert may(text) == {0, 1}
    said(text, 1, 32, 0, 32, 32, 20, 32)
    assert may(text) >= {STOP, REFLECT}
    said(text, ATTACH, 1, 0, 32, 64, 32, 32)
    assert (VALUES[TokenField.GOAL_Y][sorted(may(text))] >= 0.95).all(), "its bottom is attached already"
    said(text, 64, 32, REFLECT, 1, 0)
    assert ATTACH not in may(text)
    said(text, REFLECT, 1)
    assert may(text) == {1, 2}
    said(text, 1, STOP)
    assert text.field is None


def test_sub_program_has_the_size_of_its_cuboid_and_depth_is_limited() -> None:
    text = PartialProgram(VALUES, UNIT)
    said(text, 50, 50, 50)
    for depth in range(1, MAX_DEPTH):
        said(text, CUBOID, 40, 40, 40, 3)
        size = text.size_inputs()[:3] * (VALUES[[TokenField.SIZE_X, TokenField.SIZE_Y, TokenField.SIZE_Z], 40])
        said(text, ATTACH, 1, 0, 32, 0, 32, 32, 0, 32, STOP)
        assert text.cue == (TokenField.COMMAND, 0, 1, depth)
        np.testing.assert_allclose(text.size_inputs()[:3], size, atol=1e-3)
    said(text, CUBOID, 40, 40, 40)
    assert may(text) == {0, 1}
