"""An assembly that is being decoded: the lines that may follow by the rules of shapeassembly App. D.

- Coordinates are clamped to 0 to 1, sizes to 0.01 and those of the bounding box.
- A cuboid is attached to another once, and to the bounding box once at its top and once at its bottom, nowhere else.
- The bounding box is never moved, has no sub-program, and counts as grounded.
- Only grounded cuboids are attached to or copied.
- Cuboids are declared first, then attached, then copied.
- No cuboid reaches out of the bounding box by more than a tenth of its size.

Cuboids that stay ungrounded are left out.
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
"""Levels of a program; real ones have three."""

MAX_LINES = 60
"""Lines of an assembly; real ones have fewer."""

MAX_COPIES = 40
"""Copies of a translate; real programs have at most 29."""

MAX_LOGIT_GAP = 4.6
"""Commands with a lower logit relative to the best are not tried: 4.6 nats are a factor of 100."""

_PHASES = {CUBOID: 0, ATTACH: 1, SQUEEZE: 1, TRANSLATE: 2, REFLECT: 2}

LineChoice = tuple[int, ...]
"""A command, and the slots of the cuboids that it names."""

Joint = tuple[int, ...]
"""What an assembly may have once:

a cuboid attached to another, or to one end of the bounding box, or copied along an axis.
"""

AttachedLine = Attach | Squeeze | Translate | Reflect
"""A line after the declarations."""


@dataclass(frozen=True)
class LineNumbers:
    """The other arguments of a line.

    points: (6,), both points of an attachment.
    uv: (2,), of a squeeze.
    """

    points: FloatArray
    face: int
    uv: FloatArray
    axis: int
    copies: int
    distance: float


@dataclass
class PartialAssembly:
    """An assembly up to some line.

    box: sizes of the bounding box.
    sizes, aligned: of each declared cuboid.
    below: the assembly that expands each cuboid, or None.
    lines: the lines after the declarations; cuboids are named by their slots.
    written: number of lines, declarations included.
    """

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
        """Return the commands that may follow, bool (7,)."""
        allowed = np.zeros(7, bool)
        grounded = len(self._grounded) > 1
        allowed[STOP] = grounded
        if self.written < MAX_LINES:
            allowed[CUBOID] = self._phase == 0 and len(self.sizes) < SLOT_COUNT - 1
            allowed[[ATTACH, SQUEEZE]] = self._phase <= 1 and bool(self.sizes)
            allowed[[TRANSLATE, REFLECT]] = grounded
        return allowed

    def choices(self, logits: FloatArray, indices: FloatArray, limit: int) -> list[LineChoice]:
        """Return the lines that may follow, the likeliest command first, as the paper backtracks.

        logits: (7,), of the commands.
        indices: (7, 3, 11), logits of the slots for each command.
        limit: number of lines of each command.
        """
        allowed = self.commands()
        threshold = logits[allowed].max(initial=-np.inf) - MAX_LOGIT_GAP
        lines: list[LineChoice] = []
        for command in np.argsort(-logits, kind="stable").tolist():
            if allowed[command] and logits[command] >= threshold:
                lines += self._likeliest(command, indices[command])[:limit]
        return lines

    def _likeliest(self, command: int, logits: FloatArray) -> list[LineChoice]:
        """Return the lines of one command, the likeliest first."""
        score = {
            slots: sum(float(logits[position, slot]) for position, slot in enumerate(slots))
            for slots in self.named(command)
        }
        return [(command, *slots) for slots in sorted(score, key=lambda slots: (-score[slots], slots))]

    def named(self, command: int) -> list[tuple[int, ...]]:
        """Return the slots that a line of a command may name.

        Joints that depend on its numbers are checked by `line`.
        """
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
        """Return whether the assembly has none of the joints yet."""
        return not any(joint in self._joined for joint in joints)

    def declare(self, sizes: FloatArray, aligned: bool, below: PartialAssembly | None) -> None:
        """Declare a cuboid with clamped sizes."""
        clamped = np.clip(sizes.astype(float), MIN_CUBOID_SIZE, np.maximum(self.box, MIN_CUBOID_SIZE))
        x, y, z = np.round(np.maximum(clamped, MIN_DECLARED_SIZE), 3).tolist()
        self.sizes.append((x, y, z))
        self.aligned.append(aligned)
        self.below.append(below)
        self.written += 1

    def line(self, choice: LineChoice, numbers: LineNumbers) -> tuple[AttachedLine, list[Joint]] | None:
        """Return a line, its numbers to three decimals, with its joints.

        Returns None where it breaks a rule that can be checked without execution.
        """
        command, moved, *others = choice
        line: AttachedLine
        if command == ATTACH:
            points = np.round(np.clip(numbers.points.astype(float), 0, 1), 3).tolist()
            if others[0] == 0 and BBOX_END_SHARE < points[4] < 1 - BBOX_END_SHARE:
                return None
            joints = joints_of(choice, 2 if points[4] > 0.5 else 3)
            source, goal = points[:3], points[3:]
            line = Attach(slot_name(moved), slot_name(others[0]), (*source,), (*goal,))
        elif command == SQUEEZE:
            face = FACES[numbers.face]
            if 0 in others and face not in ("top", "bot"):
                return None
            u, v = np.round(np.clip(numbers.uv.astype(float), 0, 1), 3).tolist()
            first, second = others
            joints = joints_of(choice, numbers.face)
            line = Squeeze(slot_name(moved), slot_name(first), slot_name(second), face, u, v)
        elif command == REFLECT:
            joints = joints_of(choice, numbers.axis)
            line = Reflect(slot_name(moved), AXES[numbers.axis])
        else:
            joints = joints_of(choice, numbers.axis)
            copies = min(max(numbers.copies, 1), MAX_COPIES)
            line = Translate(
                slot_name(moved), AXES[numbers.axis], copies, round(min(max(numbers.distance, 0.0), 1.0), 3)
            )
        return (line, joints) if self.free(joints) else None

    def put(self, choice: LineChoice, line: AttachedLine, joints: Sequence[Joint]) -> None:
        """Add a line."""
        command, moved, *_ = choice
        self._joined.update(joints)
        self._grounded.add(moved)
        self._phase = max(self._phase, _PHASES[command])
        self.lines.append(line)
        self.written += 1

    def with_line(self, line: AttachedLine, moved: int) -> PartialAssembly:
        """Return the assembly with another line, which grounds a cuboid: for checks only."""
        return replace(self, lines=[*self.lines, line], _grounded={*self._grounded, moved})

    def fits(self) -> bool:
        """Return whether what is grounded stays within the bounding box."""
        try:
            return not protruding_parts(self.draft_block())
        except ProgramError:
            return False

    def draft_block(self) -> Block:
        """Return the assembly without ungrounded cuboids, which are named as in `lines`: for checks only."""
        cuboids = (Cuboid(slot_name(slot), self.sizes[slot - 1], self.aligned[slot - 1]) for slot in self.grounded)
        return Block("Program_0", Cuboid(BBOX, self.box, True), (*cuboids, *self.lines))

    def block(self, name: str, names: dict[int, str]) -> Block:
        """Return the assembly without ungrounded cuboids.

        names: the names of expanded cuboids, by slot.
        """
        names_of_slots = {BBOX: BBOX}
        names_of_slots |= {slot_name(slot): names.get(slot, f"cube{index}") for index, slot in enumerate(self.grounded)}
        cuboids = tuple(
            Cuboid(names_of_slots[slot_name(slot)], self.sizes[slot - 1], self.aligned[slot - 1])
            for slot in self.grounded
        )
        return Block(
            name, Cuboid(BBOX, self.box, True), (*cuboids, *(_renamed(line, names_of_slots) for line in self.lines))
        )

    @property
    def grounded(self) -> list[int]:
        """The slots of the grounded cuboids."""
        return sorted(self._grounded - {0})

    def program(self) -> AssemblyProgram | None:
        """Return the program with this assembly as its root; assemblies are named breadth first.

        A cuboid whose sub-program is empty stays a cuboid. Returns None where the program cannot be executed: each
        assembly can, but copies of copies may be too many.
        """
        queue: list[PartialAssembly] = [self]
        blocks: list[Block] = []
        while len(blocks) < len(queue):
            draft = queue[len(blocks)]
            names = {}
            for slot in draft.grounded:
                below = draft.below[slot - 1]
                if below is not None and below.grounded:
                    names[slot] = f"Program_{len(queue)}"
                    queue.append(below)
            blocks.append(draft.block(f"Program_{len(blocks)}", names))
        program = AssemblyProgram(tuple(blocks))
        try:
            execute(program)
        except ProgramError:
            return None
        return program


def joints_of(choice: LineChoice, end: int) -> list[Joint]:
    """Return the joints of a line.

    end: the axis of a copy, the face of a squeeze, the face of the target of an attachment; only top and bottom of the
        bounding box matter.
    """
    command, moved, *others = choice
    if command == ATTACH:
        return [_joint(moved, others[0], FACES[end] == "top")]
    if command == SQUEEZE:
        first, second = others
        return [_joint(moved, first, FACES[end] == "top"), _joint(moved, second, FACES[end] == "bot")]
    return [(moved, -1 if command == REFLECT else -2, end)]


def _joint(moved: int, target: int, top: bool) -> Joint:
    return (moved, 0, int(top)) if target == 0 else (moved, target)


def slot_name(slot: int) -> str:
    """Return the name of a cuboid in the lines of a partial assembly."""
    return f"slot{slot}" if slot else BBOX


def _renamed(line: Line, names: dict[str, str]) -> Line:
    if isinstance(line, Attach):
        return replace(line, moved=names[line.moved], target=names[line.target])
    if isinstance(line, Squeeze):
        first, second = names[line.first], names[line.second]
        return replace(line, moved=names[line.moved], first=first, second=second)
    assert not isinstance(line, Cuboid)
    return replace(line, moved=names[line.moved])
