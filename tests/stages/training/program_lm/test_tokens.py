"""Programs as words."""

from __future__ import annotations

import numpy as np
import pytest

from stages.shapeassembly import ProgramError, parse
from stages.training.program_lm.tokens import (
    NUMBER_FIELDS,
    NUMBER_STEPS,
    VOCABULARY_SIZE,
    TokenField,
    field_words,
    first_word,
    number_of_step,
    program_words,
    step_of,
    step_values,
)
from stages.training.program_vae.lines import CUBOID, STOP
from tests.stages.training.program_vae.test_lines import BOX, STOOL


def test_words_of_a_program_list_assemblies_depth_first() -> None:
    words = program_words(parse(STOOL), 1.2)
    fields = [field for field, _, _ in words]
    assert fields[:3] == [TokenField.ROOT_X, TokenField.ROOT_Y, TokenField.ROOT_Z]
    commands = [word for field, word, _ in words if field == TokenField.COMMAND]
    assert [commands.count(value) for value in (STOP, CUBOID)] == [2, 3]
    assert commands.index(STOP) == 6, "the root ends before what expands its first cuboid begins"
    said = [(field, word - first_word(field)) for field, word, _ in words]
    cuboid = said.index((TokenField.COMMAND, CUBOID))
    assert said[cuboid + 4] == (TokenField.BUILD, 3), "aligned and expanded"
    assert (TokenField.BUILD, 0) in said
    assert said.count((TokenField.COPIES, 2)) == 1
    numbers = [number for field, _, number in words if field in NUMBER_FIELDS]
    np.testing.assert_allclose(numbers[:9], [1 / 1.2, 1.0, 0.8 / 1.2, 0.9, 0.5 / 1.2, 0.7 / 0.8, 0.4, 0.1 / 1.2, 0.375])
    table = field_words()
    assert all(table[field, word] for field, word, _ in words)
    assert table.any(axis=1).all()
    assert table.shape[1] == VOCABULARY_SIZE


@pytest.mark.parametrize("field", [TokenField.SIZE_Y, TokenField.GOAL_X])
def test_steps_cover_all_numbers_and_round_to_nearest(field: TokenField) -> None:
    steps = [number_of_step(field, step) for step in range(NUMBER_STEPS + 1)]
    assert (steps[0], steps[-1]) == (0, pytest.approx(1))
    assert [step_of(field, number) for number in steps] == list(range(NUMBER_STEPS + 1))
    thin = np.diff(steps)[:10]
    assert thin.max() < (0.006 if field == TokenField.SIZE_Y else 0.016)
    assert [step_of(field, number) for number in (-1.0, 7.0)] == [0, NUMBER_STEPS]


def test_step_values_are_medians_so_that_recurring_numbers_are_exact() -> None:
    word = first_word(TokenField.GOAL_X) + 32
    values = step_values(
        [[(TokenField.GOAL_X, word, number) for number in (0.5, 0.5, 0.503)], [(TokenField.GOAL_X, word, 0.497)]]
    )
    assert values[TokenField.GOAL_X, 32] == 0.5
    assert values[TokenField.GOAL_X, 33] == 33 / NUMBER_STEPS
    assert values[TokenField.GOAL_Y, 32] == 0.5


@pytest.mark.parametrize(
    ("line", "reason"),
    [("reflect(c, X) reflect(cube1, Z)", "names a copy"), ("translate(c, X, 41, 0.5)", "too many copies")],
)
def test_program_without_words_is_rejected(line: str, reason: str) -> None:
    with pytest.raises(ProgramError, match=reason.split()[0]) as raised:
        program_words(parse(BOX[:-1] + line + " }"), 1.0)
    assert raised.value.reason == reason
