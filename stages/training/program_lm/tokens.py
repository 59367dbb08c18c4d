"""ShapeAssembly programs as words of one vocabulary: commands, cuboids, flags, faces, axes, counts and numbers.

A program begins with the sizes of the root's bounding box. An assembly is its lines and STOP, followed by the
assemblies that expand its cuboids, depth first. Each word fills a field, which determines the possible words.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from enum import IntEnum

import numpy as np

from stages.shape.arrays import BoolArray, FloatArray
from stages.shapeassembly.syntax.errors import ProgramError
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
from stages.training.program_vae.lines import ATTACH, CUBOID, REFLECT, SLOT_COUNT, SQUEEZE, START, STOP, TRANSLATE
from stages.training.program_vae.partial_assembly import MAX_COPIES


class TokenField(IntEnum):
    """The field that a word fills."""

    ROOT_X, ROOT_Y, ROOT_Z = 0, 1, 2
    COMMAND = 3
    SIZE_X, SIZE_Y, SIZE_Z, BUILD = 4, 5, 6, 7
    MOVED, TARGET = 8, 9
    SOURCE_X, SOURCE_Y, SOURCE_Z, GOAL_X, GOAL_Y, GOAL_Z = 10, 11, 12, 13, 14, 15
    FIRST, SECOND, FACE, U, V = 16, 17, 18, 19, 20
    AXIS, COPIES, DISTANCE = 21, 22, 23


COMMAND_FIELDS: dict[int, tuple[TokenField, ...]] = {
    STOP: (),
    CUBOID: (TokenField.SIZE_X, TokenField.SIZE_Y, TokenField.SIZE_Z, TokenField.BUILD),
    ATTACH: (
        TokenField.MOVED, TokenField.TARGET,
        TokenField.SOURCE_X, TokenField.SOURCE_Y, TokenField.SOURCE_Z,
        TokenField.GOAL_X, TokenField.GOAL_Y, TokenField.GOAL_Z,
    ),
    SQUEEZE: (TokenField.MOVED, TokenField.FIRST, TokenField.SECOND, TokenField.FACE, TokenField.U, TokenField.V),
    TRANSLATE: (TokenField.MOVED, TokenField.AXIS, TokenField.COPIES, TokenField.DISTANCE),
    REFLECT: (TokenField.MOVED, TokenField.AXIS),
}  # fmt: skip
"""The fields after each command."""

NUMBER_STEPS = 64
"""Steps of a number from 0 to 1. Real chairs with numbers rounded to these steps stay rooted and stable."""

_KIND_WORDS = (7, SLOT_COUNT, 4, len(FACES), len(AXES), MAX_COPIES, NUMBER_STEPS + 1)
"""Words of each kind: commands, slots, build flags, faces, axes, copies, numbers."""
_STARTS = np.cumsum([0, *_KIND_WORDS]).tolist()
VOCABULARY_SIZE: int = _STARTS[-1]

_KIND = {
    TokenField.COMMAND: 0, TokenField.MOVED: 1, TokenField.TARGET: 1, TokenField.FIRST: 1, TokenField.SECOND: 1,
    TokenField.BUILD: 2, TokenField.FACE: 3, TokenField.AXIS: 4, TokenField.COPIES: 5,
}  # fmt: skip
_NUMBER_KIND = 6

NUMBER_FIELDS = tuple(field for field in TokenField if field not in _KIND)

THIN_SHARE = 0.1
"""Sizes are quantised by the logarithm of 1 + share / THIN_SHARE, which resolves thin parts."""

Word = tuple[TokenField, int, float]
"""A field, the word that fills it, and the word's exact number, if any."""


def first_word(field: TokenField) -> int:
    """Return the first word of a field; its other words follow."""
    start: int = _STARTS[_KIND.get(field, _NUMBER_KIND)]
    return start


def field_words() -> BoolArray:
    """Return the words of each field, bool (fields, VOCABULARY_SIZE)."""
    words = np.zeros((len(TokenField), VOCABULARY_SIZE), np.bool_)
    for field in TokenField:
        kind = _KIND.get(field, _NUMBER_KIND)
        words[field, _STARTS[kind] : _STARTS[kind + 1]] = True
    words[TokenField.COMMAND, START] = False
    return words


def step_of(field: TokenField, number: float) -> int:
    """Return the step of a number: a size, as a share of the box around, or a coordinate."""
    number = min(max(number, 0.0), 1.0)
    return round(
        NUMBER_STEPS
        * (number if field > TokenField.SIZE_Z else float(np.log1p(number / THIN_SHARE) / np.log1p(1 / THIN_SHARE)))
    )


def number_of_step(field: TokenField, step: int) -> float:
    """Return the number in the middle of a step."""
    share = step / NUMBER_STEPS
    return float(THIN_SHARE * np.expm1(share * np.log1p(1 / THIN_SHARE))) if field <= TokenField.SIZE_Z else share


def program_words(program: AssemblyProgram, unit: float) -> list[Word]:
    """Return the words of a program.

    unit: length that divides the sizes of the root.
    Raises ProgramError where an assembly has more than ten cuboids, names a cuboid that no line declares, such as a
    copy, is expanded twice, or copies too often.
    """
    words = [_number(TokenField(axis), size / unit) for axis, size in enumerate(program.root.bbox.dims)]
    seen: set[str] = set()
    pending = [program.root]
    while pending:
        block = pending.pop()
        if block.name in seen:
            raise ProgramError("expanded twice", f"{block.name} stands for two cuboids; give each its own")
        seen.add(block.name)
        words += _block(block, program)
        pending += [program.named[cuboid.name] for cuboid in reversed(block.cuboids) if cuboid.name in program.named]
    return words


def _block(block: Block, program: AssemblyProgram) -> Iterator[Word]:
    slots = {name: slot for slot, name in enumerate([BBOX, *(cuboid.name for cuboid in block.cuboids)])}
    if len(slots) > SLOT_COUNT:
        raise ProgramError(
            "too many cuboids", f"{block.name} has {len(slots) - 1}, at most {SLOT_COUNT - 1} are learnt"
        )

    def slot(field: TokenField, name: str) -> Word:
        if name not in slots:
            raise ProgramError("names a copy", f"{block.name}: {name!r} is made by no Cuboid line")
        return _choice(field, slots[name])

    for line in block.lines:
        yield from _line(line, block, line.name in program.named if isinstance(line, Cuboid) else False, slot)
    yield _choice(TokenField.COMMAND, STOP)


def _line(line: Line, block: Block, expanded: bool, slot: Callable[[TokenField, str], Word]) -> Iterator[Word]:
    if isinstance(line, Cuboid):
        yield _choice(TokenField.COMMAND, CUBOID)
        for axis, size in enumerate(line.dims):
            yield _number(TokenField(TokenField.SIZE_X + axis), size / block.bbox.dims[axis])
        yield _choice(TokenField.BUILD, 2 * expanded + line.aligned)
    elif isinstance(line, Attach):
        yield from (
            _choice(TokenField.COMMAND, ATTACH),
            slot(TokenField.MOVED, line.moved),
            slot(TokenField.TARGET, line.target),
        )
        for index, number in enumerate((*line.source, *line.goal)):
            yield _number(TokenField(TokenField.SOURCE_X + index), number)
    elif isinstance(line, Squeeze):
        yield from (_choice(TokenField.COMMAND, SQUEEZE), slot(TokenField.MOVED, line.moved))
        yield from (slot(TokenField.FIRST, line.first), slot(TokenField.SECOND, line.second))
        yield from (
            _choice(TokenField.FACE, FACES.index(line.face)),
            _number(TokenField.U, line.u),
            _number(TokenField.V, line.v),
        )
    elif isinstance(line, Reflect):
        yield from (_choice(TokenField.COMMAND, REFLECT), slot(TokenField.MOVED, line.moved))
        yield _choice(TokenField.AXIS, AXES.index(line.axis))
    else:
        if line.copies > MAX_COPIES:
            raise ProgramError("too many copies", f"{block.name}: {line.copies}, at most {MAX_COPIES} are learnt")
        yield from (_choice(TokenField.COMMAND, TRANSLATE), slot(TokenField.MOVED, line.moved))
        yield from (_choice(TokenField.AXIS, AXES.index(line.axis)), _choice(TokenField.COPIES, line.copies - 1))
        yield _number(TokenField.DISTANCE, line.distance)


def _choice(field: TokenField, index: int) -> Word:
    return field, first_word(field) + index, 0.0


def _number(field: TokenField, number: float) -> Word:
    return field, first_word(field) + step_of(field, number), number


def step_values(words: list[list[Word]]) -> FloatArray:
    """Return the number of each step of each field, float64 (fields, NUMBER_STEPS + 1).

    It is the median of the numbers in the programs, so that recurring ones, such as 0, 0.5 and 1, are exact; for an
    unused step its middle.
    """
    values = np.array([[number_of_step(field, step) for step in range(NUMBER_STEPS + 1)] for field in TokenField])
    used = [(field, word, number) for program in words for field, word, number in program if field in NUMBER_FIELDS]
    steps = np.array([field * (NUMBER_STEPS + 1) + word - first_word(field) for field, word, _ in used])
    numbers = np.array([number for _, _, number in used])
    order = np.argsort(steps, kind="stable")
    kinds, starts = np.unique(steps[order], return_index=True)
    for kind, of_step in zip(kinds.tolist(), np.split(numbers[order], starts[1:]), strict=True):
        values.flat[kind] = np.median(of_step)
    return values
