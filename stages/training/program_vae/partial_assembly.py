"""An assembly while it is written: which lines may follow, by the rules of decoding (shapeassembly App. D).

Coordinates are clamped to 0 to 1, sizes to 0.01 and those of the bounding box; the bounding box is attached to at its
top and bottom alone; a cuboid is attached to another once, to the bounding box at its top and at its bottom; the
bounding box is never moved, has no sub-program, and bears others as what is grounded does; only grounded cuboids are
attached to or copied; cuboids are declared first, then attached, then copied; and no cuboid reaches further out of the
bounding box than by a tenth of its size. What is not grounded in the end is left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shapeassembly.execution.interpreter import execute
from stages.shapeassembly.execution.parameters import MIN_CUBOID_SIZE
from stages.shapeassembly.syntax.checks import BBOX_END_SHARE, protruding_parts
from stages.shapeassembly.syntax.errors import ProgramError
from stages.shapeassembly.syntax.limits import MIN_DECLARED_SIZE
from stages.shapeassembly.syntax.program import (
    AXES,
    BBOX,
    FACES,
    AssemblyProgram,
    Attach,
    Block,
    Cuboid,
    Line,
    Point,
    Reflect,
    Squeeze,
    Translate,
)
from stages.training.program_vae.lines import ATTACH, CUBOID, REFLECT, SLOT_COUNT, SQUEEZE, STOP, TRANSLATE

MAX_DEPTH = 4
"""Levels of a program; the real ones have three."""

MAX_LINES = 60
"""Lines after which an assembly ends; those of the real programs end before."""

MAX_COPIES = 40
"""Copies of one translate; the real programs have 29 at most."""

MAX_LOGIT_GAP = 4.6
"""Commands a hundred times less likely than the likeliest that may follow are no way out, in nats."""

_PHASES = {CUBOID: 0, ATTACH: 1, SQUEEZE: 1, TRANSLATE: 2, REFLECT: 2}

LineChoice = tuple[int, ...]
"""A command, and the slots of the cuboids that it names."""

Joint = tuple[int, ...]
"""What an assembly may have once: a cuboid on another, on the bottom or the top of the bounding box, or copied along an
axis by a command."""

AttachedLine = Attach | Squeeze | Translate | Reflect
"""A line behind the declarations."""


@dataclass(frozen=True)
class LineNumbers:
    """What else a line needs: points (6,), face, u and v (2,), axis, copies and distance."""

    points: FloatArray
    face: int
    uv: FloatArray
    axis: int
    copies: int
    distance: float


@dataclass
class PartialAssembly:
    """An assembly in a bounding box of sizes `box`. sizes, aligned: of each cuboid declared; below: for each, what
    expands it, if anything; lines: those after the declarations, cuboids called by their slots."""

    box: Point
    sizes: list[Point] = field(default_factory=list)
    aligned: list[bool] = field(default_factory=list)
    below: list[PartialAssembly | None] = field(default_factory=list)
    lines: list[Line] = field(default_factory=list)
    written: int = 0
    _phase: int = 0
    _grounded: set[int] = field(default_factory=lambda: {0})
    _joined: set[Joint] = field(default_factory=set)

    def commands(self) -> np.ndarray:
        """Which commands may follow, bool (7,)."""
        allowed = np.zeros(7, bool)
        grounded = len(self._grounded) > 1
        allowed[STOP] = grounded
        if self.written < MAX_LINES:
            allowed[CUBOID] = self._phase == 0 and len(self.sizes) < SLOT_COUNT - 1
            allowed[[ATTACH, SQUEEZE]] = self._phase <= 1 and bool(self.sizes)
            allowed[[TRANSLATE, REFLECT]] = grounded
        return allowed

    def choices(self, logits: FloatArray, indices: FloatArray, most: int) -> list[LineChoice]:
        """The likeliest lines that may follow, at most `most` of each command, by the logits (7,) of commands and, for
        each command, (7, 3, 11) of slots: the likeliest command first, as the paper goes back from what cannot be."""
        allowed = self.commands()
        least = logits[allowed].max(initial=-np.inf) - MAX_LOGIT_GAP
        found: list[LineChoice] = []
        for command in np.argsort(-logits, kind="stable").tolist():
            if allowed[command] and logits[command] >= least:
                found += self._likeliest(command, indices[command])[:most]
        return found

    def _likeliest(self, command: int, logits: FloatArray) -> list[LineChoice]:
        """The lines of one command, the likeliest first."""
        score = {
            each: sum(float(logits[place, slot]) for place, slot in enumerate(each)) for each in self.named(command)
        }
        return [(command, *each) for each in sorted(score, key=lambda each: (-score[each], each))]

    def named(self, command: int) -> list[tuple[int, ...]]:
        """The slots that a line of this command may name, in their order; whether they are joined already in all ways
        that there are, its numbers say."""
        if command in (STOP, CUBOID):
            return [()]
        declared, grounded = range(1, len(self.sizes) + 1), sorted(self._grounded)
        named: list[tuple[int, ...]]
        if command == ATTACH:
            named = [(a, b) for a in declared for b in grounded if a != b and ((a, b) not in self._joined or b == 0)]
        elif command == SQUEEZE:
            free = {a: [b for b in grounded if a != b and (b == 0 or (a, b) not in self._joined)] for a in declared}
            named = [(a, b, c) for a in declared for b in free[a] for c in free[a] if b != c or b == 0]
        else:
            named = [(a,) for a in grounded if a]
        return named

    def free(self, joints: Sequence[Joint]) -> bool:
        """Whether the assembly has none of them yet."""
        return not any(each in self._joined for each in joints)

    def declare(self, sizes: FloatArray, aligned: bool, below: PartialAssembly | None) -> None:
        """A cuboid, its sizes clamped."""
        clamped = np.clip(sizes.astype(float), MIN_CUBOID_SIZE, np.maximum(self.box, MIN_CUBOID_SIZE))
        x, y, z = np.round(np.maximum(clamped, MIN_DECLARED_SIZE), 3).tolist()
        self.sizes.append((x, y, z))
        self.aligned.append(aligned)
        self.below.append(below)
        self.written += 1

    def line(self, choice: LineChoice, numbers: LineNumbers) -> tuple[AttachedLine, list[Joint]] | None:
        """The line, its numbers to three decimals, with its joints; None where it breaks a rule that can be told$
        without executing it."""
        command, moved, *others = choice
        line: AttachedLine
        if command == ATTACH:
            points = np.round(np.clip(numbers.points.astype(float), 0, 1), 3).tolist()
            if others[0] == 0 and BBOX_END_SHARE < points[4] < 1 - BBOX_END_SHARE:
                return None
            joints = joints_of(choice, 2 if points[4] > 0.5 else 3)
            source, goal = points[:3], points[3:]
            line = Attach(_name(moved), _name(others[0]), (*source,), (*goal,))
        elif command == SQUEEZE:
            face = FACES[numbers.face]
            if 0 in others and face not in ("top", "bot"):
                return None
            u, v = np.round(np.clip(numbers.uv.astype(float), 0, 1), 3).tolist()
            first, second = others
            joints = joints_of(choice, numbers.face)
            line = Squeeze(_name(moved), _name(first), _name(second), face, u, v)
        elif command == REFLECT:
            joints = joints_of(choice, numbers.axis)
            line = Reflect(_name(moved), AXES[numbers.axis])
        else:
            joints = joints_of(choice, numbers.axis)
            copies = min(max(numbers.copies, 1), MAX_COPIES)
            line = Translate(_name(moved), AXES[numbers.axis], copies, round(min(max(numbers.distance, 0.0), 1.0), 3))
        return (line, joints) if self.free(joints) else None

    def put(self, choice: LineChoice, line: AttachedLine, joints: Sequence[Joint]) -> None:
        """Writes a line."""
        command, moved, *_ = choice
        self._joined.update(joints)
        self._grounded.add(moved)
        self._phase = max(self._phase, _PHASES[command])
        self.lines.append(line)
        self.written += 1

    def with_line(self, line: AttachedLine, moved: int) -> PartialAssembly:
        """With one line more, by which the cuboid of a slot is grounded: to be looked at, not to be written on."""
        return replace(self, lines=[*self.lines, line], _grounded={*self._grounded, moved})

    def fits(self) -> bool:
        """Whether what is grounded stays within the bounding box."""
        try:
            return not protruding_parts(self.block("Program_0", {}))
        except ProgramError:
            return False

    def block(self, name: str, names: dict[int, str]) -> Block:
        """The assembly, what is not grounded left out; `names` of expanded cuboids by slot."""
        kept = [slot for slot in range(1, len(self.sizes) + 1) if slot in self._grounded]
        called = {_name(0): BBOX}
        called |= {_name(slot): names.get(slot, f"cube{place}") for place, slot in enumerate(kept)}
        cuboids = tuple(Cuboid(called[_name(slot)], self.sizes[slot - 1], self.aligned[slot - 1]) for slot in kept)
        return Block(name, Cuboid(BBOX, self.box, True), (*cuboids, *(_renamed(line, called) for line in self.lines)))

    @property
    def grounded(self) -> list[int]:
        """The slots of the cuboids that are grounded."""
        return sorted(self._grounded - {0})

    def program(self) -> AssemblyProgram | None:
        """The program whose root is this assembly, its assemblies named in breadth-first order; a cuboid whose
        sub-program has no cuboid is one. None where it cannot be executed: each of its assemblies could be, and copies
        of copies may still be too many."""
        ahead: list[PartialAssembly] = [self]
        blocks: list[Block] = []
        while len(blocks) < len(ahead):
            draft = ahead[len(blocks)]
            names = {}
            for slot in draft.grounded:
                below = draft.below[slot - 1]
                if below is not None and below.grounded:
                    names[slot] = f"Program_{len(ahead)}"
                    ahead.append(below)
            blocks.append(draft.block(f"Program_{len(blocks)}", names))
        program = AssemblyProgram(tuple(blocks))
        try:
            execute(program)
        except ProgramError:
            return None
        return program


def joints_of(choice: LineChoice, way: int) -> list[Joint]:
    """The joints of a line. way: of a copy the axis, of a squeeze the face, of an attach the face of the target that is
    attached to, of which only top and bottom count, and only of the bounding box."""
    command, moved, *others = choice
    if command == ATTACH:
        return [_joint(moved, others[0], FACES[way] == "top")]
    if command == SQUEEZE:
        first, second = others
        return [_joint(moved, first, FACES[way] == "top"), _joint(moved, second, FACES[way] == "bot")]
    return [(moved, -1 if command == REFLECT else -2, way)]


def _joint(moved: int, target: int, top: bool) -> Joint:
    return (moved, 0, int(top)) if target == 0 else (moved, target)


def _name(slot: int) -> str:
    return f"slot{slot}"


def _renamed(line: Line, called: dict[str, str]) -> Line:
    if isinstance(line, Attach):
        return replace(line, moved=called[line.moved], target=called[line.target])
    if isinstance(line, Squeeze):
        first, second = called[line.first], called[line.second]
        return replace(line, moved=called[line.moved], first=first, second=second)
    assert not isinstance(line, Cuboid)
    return replace(line, moved=called[line.moved])
