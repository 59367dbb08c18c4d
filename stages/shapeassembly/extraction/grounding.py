"""Orders attachments: each part is attached to what stands already (shapeassembly §5.2, App. C)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from stages.shape.arrays import FloatArray
from stages.shapeassembly.extraction.hierarchy import Box
from stages.shapeassembly.extraction.joints import (
    BACK,
    BOTTOM,
    LEFT,
    TOP,
    Joint,
    PlacedBoxes,
    attach,
    attach_contact,
    squeeze,
)
from stages.shapeassembly.extraction.node_layout import BBOX_INDEX, NodeLayout
from stages.shapeassembly.syntax.program import Squeeze

MAX_GOOD_COST = 0.01
"""Cost up to which a tilted part takes its place in canonical order; others wait for what they may be attached to."""


@dataclass(frozen=True)
class TiltedPlacement:
    """The lines that ground a tilted part, the box that they make of it, and their cost: mean misplacement of its
    corners as a share of the bounding box's diagonal, and a little for each line."""

    lines: tuple[Joint, ...]
    box: Box
    cost: float


TiltedPlacer = Callable[[int, list[Joint], PlacedBoxes], TiltedPlacement | None]
"""Places a tilted part: given its index, the lines so far and what stands; None if it touches nothing that stands."""


MAX_JOINTS = 2
"""Attachments of one aligned part, as in the published programs; the first places it, the second keeps it joined."""


def ground_parts(layout: NodeLayout, place_tilted: TiltedPlacer) -> list[Joint] | None:
    """The attach and squeeze lines of a node in grounded order, or None if some part has no way to the box.

    Aligned parts at the bounding box come first, then in turns the aligned parts that touch what stands, in canonical
    order; a part that can be squeezed waits for both its partners, a tilted one for all aligned parts that can stand
    without it. A second contact of an aligned part is written too: it keeps parts together when numbers change.
    """
    return _Grounding(layout, place_tilted).run()


class _Grounding:
    """Lines so far, the boxes that stand, and the pairs of parts that a line has joined."""

    def __init__(self, layout: NodeLayout, place_tilted: TiltedPlacer) -> None:
        self.layout = layout
        self.place_tilted = place_tilted
        self.lines: list[Joint] = []
        self.standing: dict[int, Box] = {BBOX_INDEX: layout.bbox}
        self.joined: set[tuple[int, int]] = set()
        self.joints = [0] * len(layout.parts)

    def run(self) -> list[Joint] | None:
        steps = (self._ground_at_box, self._turn, self._ground_waiting, self._ground_tilted)
        while any(step() for step in steps):
            pass
        return self.lines if len(self.standing) > len(self.layout.parts) else None

    def _ground_at_box(self) -> bool:
        """Grounds aligned parts at the bounding box until all that are left there wait for a partner."""
        moved = False
        again = True
        while again:
            again = False
            for part in self._loose(aligned=True):
                again |= self._ground_one_at_box(part)
            moved |= again
        return moved

    def _ground_one_at_box(self, part: int) -> bool:
        bottom, top = self.layout.bottoms[part], self.layout.tops[part]
        if bottom is not None and top is not None:
            line = squeeze(self.layout, self.standing, part, (BBOX_INDEX, BBOX_INDEX), TOP)
            return self._stand(part, [line or self._at_box(part, bottom)])
        point = bottom if bottom is not None else top
        if point is None:
            return False
        face = BOTTOM if bottom is not None else TOP
        waits = False
        for other in self.layout.neighbours(part):
            if not self.layout.may_attach(part, other):
                continue
            between = squeeze(self.layout, self.standing, part, (BBOX_INDEX, other), face)
            if between is not None and other in self.standing:
                return self._stand(part, [between], other)
            waits |= between is not None
        return not waits and self._stand(part, [self._at_box(part, point)])

    def _turn(self) -> bool:
        """One turn over the aligned parts: what touches what stands is grounded or joined once more."""
        moved = False
        for part in range(len(self.layout.parts)):
            others = self._targets(part)
            if not others or not self.layout.aligned(part):
                continue
            if part in self.standing:
                moved |= self._join(part, others[: MAX_JOINTS - self.joints[part]])
            elif self.layout.bottoms[part] is None and self.layout.tops[part] is None:
                moved |= self._ground_between(part, others)
        return moved

    def _targets(self, part: int) -> list[int]:
        """What a part may be attached to next: standing neighbours, those first that the centre of a face touches."""
        others = [each for each in self.layout.neighbours(part) if each in self.standing]
        others = [
            each for each in others if self.layout.may_attach(part, each) and _pair(part, each) not in self.joined
        ]
        return sorted(others, key=lambda each: (not self.layout.at_face_center(part, each), each))

    def _ground_between(self, part: int, others: list[int]) -> bool:
        """Grounds a part at its neighbours: by a squeeze, if two of them hold it at opposite faces."""
        for face in (LEFT, BOTTOM, BACK):
            for first in others:
                for second in others:
                    line = squeeze(self.layout, self.standing, part, (first, second), face) if first != second else None
                    if line is not None:
                        return self._stand(part, [line], first, second)
        return self._join(part, others[:MAX_JOINTS])

    def _join(self, part: int, others: list[int]) -> bool:
        return self._stand(part, [attach_contact(self.layout, self.standing, part, each) for each in others], *others)

    def _ground_tilted(self) -> bool:
        """Grounds the first tilted part that can be placed well, or else the one that can be placed best."""
        best: tuple[int, TiltedPlacement] | None = None
        for part in self._loose(aligned=False):
            placing = self.place_tilted(part, self.lines, self.standing)
            if placing is not None and (best is None or placing.cost < best[1].cost):
                best = (part, placing)
                if placing.cost <= MAX_GOOD_COST:
                    break
        if best is None:
            return False
        part, placing = best
        self._stand(part, placing.lines, *(each for each in self.layout.neighbours(part) if each in self.standing))
        self.standing[part] = placing.box
        return True

    def _ground_waiting(self) -> bool:
        """Grounds the first part that waits at the bounding box for a partner that cannot stand before it."""
        for part in self._loose(aligned=True):
            for point in (self.layout.bottoms[part], self.layout.tops[part]):
                if point is not None:
                    return self._stand(part, [self._at_box(part, point)])
        return False

    def _loose(self, *, aligned: bool) -> list[int]:
        parts = range(len(self.layout.parts))
        return [part for part in parts if part not in self.standing and self.layout.aligned(part) == aligned]

    def _at_box(self, part: int, point: FloatArray) -> Joint:
        return attach(self.layout, self.standing, part, BBOX_INDEX, point, point)

    def _stand(self, part: int, lines: Sequence[Joint], *others: int) -> bool:
        """Writes lines that ground or further join a part; whether there were any."""
        if lines:
            self.standing.setdefault(part, self.layout.parts[part].box)
            self.lines += lines
            self.joints[part] += sum(2 if isinstance(line, Squeeze) else 1 for line in lines)
            self.joined |= {_pair(part, other) for other in others}
        return bool(lines)


def _pair(first: int, second: int) -> tuple[int, int]:
    return min(first, second), max(first, second)
