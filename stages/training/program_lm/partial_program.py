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
"""Sizes that are seen beside a word: of the box, of the cuboid that the line is about, and of that it is brought to."""

_OF_FIELD = field_words()
_COPIED = (TRANSLATE, REFLECT)
_WAYS = {ATTACH: (2, 3), SQUEEZE: range(len(FACES)), TRANSLATE: range(3), REFLECT: range(3)}
_NAMED = (TokenField.MOVED, TokenField.TARGET, TokenField.FIRST, TokenField.SECOND)


@dataclass
class PartialProgram:
    """values: what steps stand for, float64 (fields, STEPS + 1); unit: what the root's sizes are shares of."""

    values: FloatArray
    unit: float
    root: PartialAssembly | None = None
    _draft: PartialAssembly = field(default_factory=lambda: PartialAssembly((0.0, 0.0, 0.0)))
    _depth: int = 0
    _owner: int = 0
    _ahead: list[tuple[PartialAssembly, int, int]] = field(default_factory=list)
    _command: int = STOP
    _fields: list[TokenField] = field(default_factory=lambda: [TokenField.ROOT_X, TokenField.ROOT_Y, TokenField.ROOT_Z])
    _said: list[int] = field(default_factory=list)
    _lines: list[LineChoice] = field(default_factory=list)

    @property
    def field(self) -> TokenField | None:
        """What the next word says; None behind the end."""
        return self._fields[len(self._said)] if self._fields else None

    @property
    def cue(self) -> tuple[int, int, int, int]:
        """What is known of the next word: its field, the cuboid that its line is about, that which the assembly
        expands, and how deep that stands. Not behind the end."""
        return int(self._fields[len(self._said)]), self._subject(), self._owner, self._depth

    def seen(self) -> FloatArray:
        """Sizes of the box, of the line's cuboid and of that it is brought to, as shares of the unit; float64 (SEEN,);
        0 where none is."""
        found = np.zeros(SIZE_INPUTS)
        if self.root is None:
            found[: len(self._said)] = self._numbers(TokenField.ROOT_X, self._said)
            return found
        sizes = [self._draft.box, *self._draft.sizes]
        found[:3] = sizes[0]
        subject = self._subject()
        if subject and subject < len(sizes):
            found[3:6] = sizes[subject]
        if self._command in (ATTACH, SQUEEZE) and len(self._said) > 1:
            found[6:] = sizes[self._said[1]]
        return found / self.unit

    def _subject(self) -> int:
        if self._command == CUBOID:
            return len(self._draft.sizes) + 1
        return self._said[0] if self._command != STOP and self._said else 0

    def allowed(self) -> BoolArray:
        """Which words may come next, bool (WORDS,); at least one may, until the end."""
        now = self._fields[len(self._said)]
        found: BoolArray = _OF_FIELD[now]
        places = self._places(now)
        if places is not None:
            found = np.zeros(len(found), np.bool_)
            found[first_word(now) + np.array(places)] = True
        return found

    def _places(self, now: TokenField) -> list[int] | None:
        """Which of the words of a field may come; None for all."""
        if now == TokenField.COMMAND:
            return self._commands()
        if now == TokenField.BUILD:
            return None if self._depth + 1 < MAX_DEPTH else [0, 1]
        if now in _NAMED:
            place = len(self._said)
            return sorted({each[place + 1] for each in self._lines if list(each[1 : place + 1]) == self._said})
        if now == TokenField.FACE:
            return self._ways((SQUEEZE, *self._said))
        if now == TokenField.AXIS:
            return self._ways((self._command, *self._said))
        if now == TokenField.GOAL_Y and self._said[1] == 0:
            heights = self.values[now]
            ends = {2: heights >= 1 - BBOX_END_SHARE, 3: heights <= BBOX_END_SHARE}
            free = [ends[way] for way in self._ways((ATTACH, *self._said[:2]))]
            return np.flatnonzero(np.logical_or.reduce(free)).tolist()
        return None

    def _commands(self) -> list[int]:
        draft = self._draft
        loose = len(draft.sizes) - len(draft.grounded)
        last = draft.written + loose >= MAX_LINES
        found = []
        if draft.sizes and not loose:
            found.append(STOP)
        allowed = draft.commands()
        if allowed[CUBOID] and draft.written + loose + 2 <= MAX_LINES:
            found.append(CUBOID)
        others = (ATTACH, SQUEEZE) if loose else (ATTACH, SQUEEZE, *_COPIED)
        return found + [each for each in others if allowed[each] and self._ways_of(each, last)]

    def _ways_of(self, command: int, last: bool) -> list[LineChoice]:
        """The lines of a command that keep the rules; if they are the last, of cuboids that must still be attached."""
        grounded = self._draft.grounded
        return [
            (command, *each)
            for each in self._draft.named(command)
            if not (last and each[0] in grounded) and self._ways((command, *each))
        ]

    def _ways(self, choice: LineChoice) -> list[int]:
        """The faces or axes of a line that keep the rules."""
        ends = (2, 3) if choice[0] == SQUEEZE and 0 in choice[2:] else _WAYS[choice[0]]
        return [way for way in ends if self._draft.free(joints_of(choice, way))]

    def take(self, word: int, *, fit: bool) -> bool:
        """Write a word, which must be allowed. With `fit`, a line that would reach out of the box is refused; whether
        the word was written. What was refused leaves a text of no further use."""
        now = self._fields[len(self._said)]
        self._said.append(word - first_word(now))
        if len(self._said) < len(self._fields):
            return True
        said, self._said = self._said, []
        if self.root is None:
            x, y, z = np.round(
                np.maximum(self.unit * self._numbers(TokenField.ROOT_X, said), 2 * MIN_CUBOID_SIZE), 3
            ).tolist()
            self.root = self._draft = PartialAssembly((x, y, z))
        elif now == TokenField.COMMAND:
            self._command = said[0]
            if self._command == STOP:
                self._stop()
                return True
            self._fields = list(COMMAND_FIELDS[self._command])
            if self._command != CUBOID:
                draft = self._draft
                last = draft.written + len(draft.sizes) - len(draft.grounded) >= MAX_LINES
                self._lines = self._ways_of(self._command, last)
            return True
        elif self._command == CUBOID:
            self._declare(said)
        elif not self._write(said, fit):
            return False
        self._command, self._fields = STOP, [TokenField.COMMAND]
        return True

    def _declare(self, said: list[int]) -> None:
        draft = self._draft
        draft.declare(self._numbers(TokenField.SIZE_X, said[:3]) * draft.box, bool(said[3] % 2), None)
        if said[3] >= 2:
            draft.below[-1] = PartialAssembly(draft.sizes[-1])

    def _write(self, said: list[int], fit: bool) -> bool:
        named = sum(each in _NAMED for each in self._fields)
        choice = (self._command, *said[:named])
        zeros = np.zeros(6)
        rest = said[named:]
        copied = self._command in _COPIED
        numbers = LineNumbers(
            points=self._numbers(TokenField.SOURCE_X, rest) if self._command == ATTACH else zeros,
            face=rest[0] if self._command == SQUEEZE else 0,
            uv=self._numbers(TokenField.U, rest[1:]) if self._command == SQUEEZE else zeros[:2],
            axis=rest[0] if copied else 0,
            copies=rest[1] + 1 if self._command == TRANSLATE else 1,
            distance=float(self.values[TokenField.DISTANCE, rest[2]]) if self._command == TRANSLATE else 0.0,
        )
        found = self._draft.line(choice, numbers)
        assert found is not None, "a word that is not allowed was taken"
        if fit and not self._draft.with_line(found[0], choice[1]).fits():
            return False
        self._draft.put(choice, *found)
        return True

    def _stop(self) -> None:
        below = [(draft, slot, self._depth + 1) for slot, draft in enumerate(self._draft.below, 1) if draft is not None]
        self._ahead += reversed(below)
        self._fields = []
        if self._ahead:
            self._draft, self._owner, self._depth = self._ahead.pop()
            self._fields = [TokenField.COMMAND]

    def _numbers(self, first: TokenField, said: list[int]) -> FloatArray:
        """What steps stand for in fields that follow each other."""
        return self.values[np.arange(first, first + len(said)), said]

    def program(self) -> AssemblyProgram | None:
        """The program behind its end; None where it cannot be executed, for copies of copies may be too many."""
        assert self.root is not None
        return self.root.program()
