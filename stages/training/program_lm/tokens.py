"""ShapeAssembly programs as words of one vocabulary: commands, cuboids, flags, faces, axes, counts and numbers.

An assembly is its lines and STOP; behind it stand the assemblies that expand its cuboids, in the order of their
declarations, each followed by its own. First of all come the sizes of the root's bounding box. Which word may stand
where is said by the field that it fills.
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
    Attach,
    Block,
    Cuboid,
    Line,
    Program,
    Reflect,
    Squeeze,
)
from stages.training.program_vae.lines import ATTACH, CUBOID, REFLECT, SLOTS, SQUEEZE, START, STOP, TRANSLATE
from stages.training.program_vae.partial_assembly import MOST_COPIES


class Field(IntEnum):
    """What a word says."""

    ROOT_X, ROOT_Y, ROOT_Z = 0, 1, 2
    COMMAND = 3
    SIZE_X, SIZE_Y, SIZE_Z, BUILD = 4, 5, 6, 7
    MOVED, TARGET = 8, 9
    SOURCE_X, SOURCE_Y, SOURCE_Z, GOAL_X, GOAL_Y, GOAL_Z = 10, 11, 12, 13, 14, 15
    FIRST, SECOND, FACE, U, V = 16, 17, 18, 19, 20
    AXIS, COPIES, DISTANCE = 21, 22, 23


FIELDS: dict[int, tuple[Field, ...]] = {
    STOP: (),
    CUBOID: (Field.SIZE_X, Field.SIZE_Y, Field.SIZE_Z, Field.BUILD),
    ATTACH: (
        Field.MOVED, Field.TARGET,
        Field.SOURCE_X, Field.SOURCE_Y, Field.SOURCE_Z,
        Field.GOAL_X, Field.GOAL_Y, Field.GOAL_Z,
    ),
    SQUEEZE: (Field.MOVED, Field.FIRST, Field.SECOND, Field.FACE, Field.U, Field.V),
    TRANSLATE: (Field.MOVED, Field.AXIS, Field.COPIES, Field.DISTANCE),
    REFLECT: (Field.MOVED, Field.AXIS),
}  # fmt: skip
"""What follows each command."""

STEPS = 64
"""Steps from 0 to 1 of a number. Real chairs whose numbers are rounded so are rooted and stable as before."""

_COMMANDS, _SLOTS, _BUILDS, _FACES, _AXES, _COPIES = 7, SLOTS, 4, len(FACES), len(AXES), MOST_COPIES
_STARTS = np.cumsum([0, _COMMANDS, _SLOTS, _BUILDS, _FACES, _AXES, _COPIES, STEPS + 1]).tolist()
WORDS: int = _STARTS[-1]
"""Words of the vocabulary."""

_KIND = {
    Field.COMMAND: 0, Field.MOVED: 1, Field.TARGET: 1, Field.FIRST: 1, Field.SECOND: 1,
    Field.BUILD: 2, Field.FACE: 3, Field.AXIS: 4, Field.COPIES: 5,
}  # fmt: skip
_NUMBER = 6

NUMBERS = tuple(each for each in Field if each not in _KIND)
"""The fields that numbers fill."""

THIN = 0.1
"""Sizes are counted by the logarithm of 1 + share / THIN, so that those of thin parts are told apart."""

Word = tuple[Field, int, float]
"""A field, the word that fills it, and the number that it stands for, if any."""


def first_word(field: Field) -> int:
    """The first word of those that may fill a field; the others stand behind it."""
    start: int = _STARTS[_KIND.get(field, _NUMBER)]
    return start


def words_of_fields() -> BoolArray:
    """Which words may fill which field, bool (fields, WORDS)."""
    found = np.zeros((len(Field), WORDS), np.bool_)
    for field in Field:
        kind = _KIND.get(field, _NUMBER)
        found[field, _STARTS[kind] : _STARTS[kind + 1]] = True
    found[Field.COMMAND, START] = False
    return found


def step_of(field: Field, number: float) -> int:
    """The step of a number: of a size, a share of the box around, or of a coordinate."""
    number = min(max(number, 0.0), 1.0)
    return round(STEPS * (number if field > Field.SIZE_Z else float(np.log1p(number / THIN) / np.log1p(1 / THIN))))


def number_of_step(field: Field, step: int) -> float:
    """The number in the middle of a step."""
    share = step / STEPS
    return float(THIN * np.expm1(share * np.log1p(1 / THIN))) if field <= Field.SIZE_Z else share


def words_of(program: Program, unit: float) -> list[Word]:
    """The words of a program. unit: the length that the sizes of its root are shares of.

    Raises ProgramError where an assembly has more than ten cuboids, names cuboids that no line declares (copies among
    them), is expanded twice, or copies too often.
    """
    words = [_number(Field(axis), size / unit) for axis, size in enumerate(program.root.bbox.dims)]
    seen: set[str] = set()
    ahead = [program.root]
    while ahead:
        block = ahead.pop()
        if block.name in seen:
            raise ProgramError("expanded twice", f"{block.name} stands for two cuboids; give each its own")
        seen.add(block.name)
        words += _block(block, program)
        ahead += [program.named[each.name] for each in reversed(block.cuboids) if each.name in program.named]
    return words


def _block(block: Block, program: Program) -> Iterator[Word]:
    slots = {name: slot for slot, name in enumerate([BBOX, *(each.name for each in block.cuboids)])}
    if len(slots) > SLOTS:
        raise ProgramError("too many cuboids", f"{block.name} has {len(slots) - 1}, at most {SLOTS - 1} are learnt")

    def slot(field: Field, name: str) -> Word:
        if name not in slots:
            raise ProgramError("names a copy", f"{block.name}: {name!r} is made by no Cuboid line")
        return _choice(field, slots[name])

    for line in block.lines:
        yield from _line(line, block, line.name in program.named if isinstance(line, Cuboid) else False, slot)
    yield _choice(Field.COMMAND, STOP)


def _line(line: Line, block: Block, expanded: bool, slot: Callable[[Field, str], Word]) -> Iterator[Word]:
    if isinstance(line, Cuboid):
        yield _choice(Field.COMMAND, CUBOID)
        for axis, size in enumerate(line.dims):
            yield _number(Field(Field.SIZE_X + axis), size / block.bbox.dims[axis])
        yield _choice(Field.BUILD, 2 * expanded + line.aligned)
    elif isinstance(line, Attach):
        yield from (_choice(Field.COMMAND, ATTACH), slot(Field.MOVED, line.moved), slot(Field.TARGET, line.target))
        for place, number in enumerate((*line.source, *line.goal)):
            yield _number(Field(Field.SOURCE_X + place), number)
    elif isinstance(line, Squeeze):
        yield from (_choice(Field.COMMAND, SQUEEZE), slot(Field.MOVED, line.moved))
        yield from (slot(Field.FIRST, line.first), slot(Field.SECOND, line.second))
        yield from (_choice(Field.FACE, FACES.index(line.face)), _number(Field.U, line.u), _number(Field.V, line.v))
    elif isinstance(line, Reflect):
        yield from (_choice(Field.COMMAND, REFLECT), slot(Field.MOVED, line.moved))
        yield _choice(Field.AXIS, AXES.index(line.axis))
    else:
        if line.copies > MOST_COPIES:
            raise ProgramError("too many copies", f"{block.name}: {line.copies}, at most {MOST_COPIES} are learnt")
        yield from (_choice(Field.COMMAND, TRANSLATE), slot(Field.MOVED, line.moved))
        yield from (_choice(Field.AXIS, AXES.index(line.axis)), _choice(Field.COPIES, line.copies - 1))
        yield _number(Field.DISTANCE, line.distance)


def _choice(field: Field, place: int) -> Word:
    return field, first_word(field) + place, 0.0


def _number(field: Field, number: float) -> Word:
    return field, first_word(field) + step_of(field, number), number


def middles(words: list[list[Word]]) -> FloatArray:
    """What each step of each field stands for, float64 (fields, STEPS + 1): the median of the numbers of programs that
    it was said of, so that those that recur, such as 0, 0.5 and 1, are exact; where there are none, its middle."""
    found = np.array([[number_of_step(field, step) for step in range(STEPS + 1)] for field in Field])
    told = [(field, word, number) for program in words for field, word, number in program if field in NUMBERS]
    of = np.array([field * (STEPS + 1) + word - first_word(field) for field, word, _ in told])
    numbers = np.array([number for _, _, number in told])
    order = np.argsort(of, kind="stable")
    kinds, starts = np.unique(of[order], return_index=True)
    for kind, some in zip(kinds.tolist(), np.split(numbers[order], starts[1:]), strict=True):
        found.flat[kind] = np.median(some)
    return found
