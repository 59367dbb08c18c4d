"""A program that is generated word by word: its state, and the words that may follow (shapeassembly App. D).

`PartialAssembly` holds the rules of an assembly. In addition, every cuboid is attached before any is copied and before
the assembly ends, so that no cuboid has to be left out.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from stages.shape.arrays import BoolArray, FloatArray
from stages.shapeassembly.execution.parameters import MIN_CUBOID_SIZE
from stages.shapeassembly.syntax.checks import BBOX_END_SHARE
from stages.shapeassembly.syntax.program import FACES, AssemblyProgram
from stages.training.program_lm.tokens import COMMAND_FIELDS, TokenField, field_words, first_word
from stages.training.program_vae.lines import ATTACH, CUBOID, REFLECT, SQUEEZE, STOP, TRANSLATE
from stages.training.program_vae.partial_assembly import (
    MAX_DEPTH,
    MAX_LINES,
    LineChoice,
    LineNumbers,
    PartialAssembly,
    joints_of,
)

SIZE_INPUTS = 9
"""Sizes of the bounding box, of the line's cuboid and of its target."""

_FIELD_WORDS = field_words()
_COPIED = (TRANSLATE, REFLECT)
_FACES_OR_AXES = {ATTACH: (2, 3), SQUEEZE: range(len(FACES)), TRANSLATE: range(3), REFLECT: range(3)}
_NAMED = (TokenField.MOVED, TokenField.TARGET, TokenField.FIRST, TokenField.SECOND)


@dataclass
class PartialProgram:
    """A program up to some word.

    values: float64 (fields, NUMBER_STEPS + 1), the number of each step.
    unit: length that divides the root's sizes.
    """

    values: FloatArray
    unit: float
    root: PartialAssembly | None = None
    _draft: PartialAssembly = field(default_factory=lambda: PartialAssembly((0.0, 0.0, 0.0)))
    _depth: int = 0
    _owner: int = 0
    _pending: list[tuple[PartialAssembly, int, int]] = field(default_factory=list)
    _command: int = STOP
    _fields: list[TokenField] = field(default_factory=lambda: [TokenField.ROOT_X, TokenField.ROOT_Y, TokenField.ROOT_Z])
    _words: list[int] = field(default_factory=list)
    _lines: list[LineChoice] = field(default_factory=list)

    @property
    def field(self) -> TokenField | None:
        """The field that the next word fills; None behind the end."""
        return self._fields[len(self._words)] if self._fields else None

    @property
    def cue(self) -> tuple[int, int, int, int]:
        """The context of the next word: its field, the line's cuboid, the cuboid that the assembly expands, the depth.

        It is undefined behind the end.
        """
        return int(self._fields[len(self._words)]), self._subject(), self._owner, self._depth

    def size_inputs(self) -> FloatArray:
        """Return the sizes of the box, of the line's cuboid and of its target, float64 (SIZE_INPUTS,).

        Unit: `unit`. Missing ones are 0.
        """
        inputs = np.zeros(SIZE_INPUTS)
        if self.root is None:
            inputs[: len(self._words)] = self._numbers(TokenField.ROOT_X, self._words)
            return inputs
        sizes = [self._draft.box, *self._draft.sizes]
        inputs[:3] = sizes[0]
        subject = self._subject()
        if subject and subject < len(sizes):
            inputs[3:6] = sizes[subject]
        if self._command in (ATTACH, SQUEEZE) and len(self._words) > 1:
            inputs[6:] = sizes[self._words[1]]
        return inputs / self.unit

    def _subject(self) -> int:
        if self._command == CUBOID:
            return len(self._draft.sizes) + 1
        return self._words[0] if self._command != STOP and self._words else 0

    def allowed(self) -> BoolArray:
        """Return the words that may follow, bool (VOCABULARY_SIZE,); before the end there is at least one."""
        field = self._fields[len(self._words)]
        allowed: BoolArray = _FIELD_WORDS[field]
        choices = self._choices(field)
        if choices is not None:
            allowed = np.zeros(len(allowed), np.bool_)
            allowed[first_word(field) + np.array(choices)] = True
        return allowed

    def _choices(self, field: TokenField) -> list[int] | None:
        """Return which of the words of a field may follow; None for all."""
        if field == TokenField.COMMAND:
            return self._commands()
        if field == TokenField.BUILD:
            return None if self._depth + 1 < MAX_DEPTH else [0, 1]
        if field in _NAMED:
            index = len(self._words)
            return sorted({line[index + 1] for line in self._lines if list(line[1 : index + 1]) == self._words})
        if field == TokenField.FACE:
            return self._free_ends((SQUEEZE, *self._words))
        if field == TokenField.AXIS:
            return self._free_ends((self._command, *self._words))
        if field == TokenField.GOAL_Y and self._words[1] == 0:
            heights = self.values[field]
            ends = {2: heights >= 1 - BBOX_END_SHARE, 3: heights <= BBOX_END_SHARE}
            free = [ends[end] for end in self._free_ends((ATTACH, *self._words[:2]))]
            return np.flatnonzero(np.logical_or.reduce(free)).tolist()
        return None

    def _commands(self) -> list[int]:
        draft = self._draft
        loose = len(draft.sizes) - len(draft.grounded)
        last = draft.written + loose >= MAX_LINES
        commands = []
        if draft.sizes and not loose:
            commands.append(STOP)
        allowed = draft.commands()
        if allowed[CUBOID] and draft.written + loose + 2 <= MAX_LINES:
            commands.append(CUBOID)
        others = (ATTACH, SQUEEZE) if loose else (ATTACH, SQUEEZE, *_COPIED)
        return commands + [command for command in others if allowed[command] and self._possible_lines(command, last)]

    def _possible_lines(self, command: int, last: bool) -> list[LineChoice]:
        """Return the lines of a command that keep the rules.

        last: whether the remaining lines are needed for cuboids that are not attached yet.
        """
        grounded = self._draft.grounded
        return [
            (command, *slots)
            for slots in self._draft.named(command)
            if not (last and slots[0] in grounded) and self._free_ends((command, *slots))
        ]

    def _free_ends(self, choice: LineChoice) -> list[int]:
        """Return the faces or axes of a line that keep the rules."""
        ends = (2, 3) if choice[0] == SQUEEZE and 0 in choice[2:] else _FACES_OR_AXES[choice[0]]
        return [end for end in ends if self._draft.free(joints_of(choice, end))]

    def take(self, word: int, *, fit: bool) -> bool:
        """Append a word, which must be allowed. Returns whether it was.

        fit: refuse a line that would reach out of the box; the object is then of no further use.
        """
        field = self._fields[len(self._words)]
        self._words.append(word - first_word(field))
        if len(self._words) < len(self._fields):
            return True
        words, self._words = self._words, []
        if self.root is None:
            x, y, z = np.round(
                np.maximum(self.unit * self._numbers(TokenField.ROOT_X, words), 2 * MIN_CUBOID_SIZE), 3
            ).tolist()
            self.root = self._draft = PartialAssembly((x, y, z))
        elif field == TokenField.COMMAND:
            self._command = words[0]
            if self._command == STOP:
                self._stop()
                return True
            self._fields = list(COMMAND_FIELDS[self._command])
            if self._command != CUBOID:
                draft = self._draft
                last = draft.written + len(draft.sizes) - len(draft.grounded) >= MAX_LINES
                self._lines = self._possible_lines(self._command, last)
            return True
        elif self._command == CUBOID:
            self._declare(words)
        elif not self._write(words, fit):
            return False
        self._command, self._fields = STOP, [TokenField.COMMAND]
        return True

    def _declare(self, words: list[int]) -> None:
        draft = self._draft
        draft.declare(self._numbers(TokenField.SIZE_X, words[:3]) * draft.box, bool(words[3] % 2), None)
        if words[3] >= 2:
            draft.below[-1] = PartialAssembly(draft.sizes[-1])

    def _write(self, words: list[int], fit: bool) -> bool:
        named = sum(field in _NAMED for field in self._fields)
        choice = (self._command, *words[:named])
        zeros = np.zeros(6)
        rest = words[named:]
        copied = self._command in _COPIED
        numbers = LineNumbers(
            points=self._numbers(TokenField.SOURCE_X, rest) if self._command == ATTACH else zeros,
            face=rest[0] if self._command == SQUEEZE else 0,
            uv=self._numbers(TokenField.U, rest[1:]) if self._command == SQUEEZE else zeros[:2],
            axis=rest[0] if copied else 0,
            copies=rest[1] + 1 if self._command == TRANSLATE else 1,
            distance=float(self.values[TokenField.DISTANCE, rest[2]]) if self._command == TRANSLATE else 0.0,
        )
        line = self._draft.line(choice, numbers)
        assert line is not None, "a word that is not allowed was taken"
        if fit and not self._draft.with_line(line[0], choice[1]).fits():
            return False
        self._draft.put(choice, *line)
        return True

    def _stop(self) -> None:
        below = [(draft, slot, self._depth + 1) for slot, draft in enumerate(self._draft.below, 1) if draft is not None]
        self._pending += reversed(below)
        self._fields = []
        if self._pending:
            self._draft, self._owner, self._depth = self._pending.pop()
            self._fields = [TokenField.COMMAND]

    def _numbers(self, first: TokenField, steps: list[int]) -> FloatArray:
        """Return the numbers of steps in consecutive fields."""
        return self.values[np.arange(first, first + len(steps)), steps]

    def program(self) -> AssemblyProgram | None:
        """Return the finished program, or None where it cannot be executed: copies of copies may be too many."""
        assert self.root is not None
        return self.root.program()
