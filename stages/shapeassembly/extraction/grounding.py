"""Orders attachments: each part is attached to what stands already (shapeassembly §5.2, App. C)."""

from __future__ import annotations

from collections.abc import Callable

from stages.shape.arrays import FloatArray
from stages.shapeassembly.extraction.hierarchy import Box
from stages.shapeassembly.extraction.joints import (
    BACK,
    BOTTOM,
    LEFT,
    TOP,
    Joint,
    Standing,
    attach,
    attach_contact,
    squeeze,
)
from stages.shapeassembly.extraction.layout import BBOX, Layout

__all__ = ["Placer", "ground"]

Placer = Callable[[int, list[Joint], Standing], tuple[list[Joint], Box] | None]
"""Places a tilted part: given its index, the lines so far and what stands, the lines that ground it and the box that
they make of it; None if it touches nothing that stands."""


def ground(layout: Layout, place_tilted: Placer) -> list[Joint]:
    """The attach and squeeze lines of a node whose parts hang together, in grounded order.

    Aligned parts at the bounding box come first, then in turns the aligned parts that touch what stands, in canonical
    order; a part that can be squeezed waits for both its partners, a tilted one for all aligned parts that can stand
    without it. Further contacts of aligned parts are written too: they keep parts together when numbers change.
    """
    return _Grounding(layout, place_tilted).run()


class _Grounding:
    """Lines so far, the boxes that stand, and the pairs of parts that a line has joined."""

    def __init__(self, layout: Layout, place_tilted: Placer) -> None:
        self.layout = layout
        self.place_tilted = place_tilted
        self.lines: list[Joint] = []
        self.standing: dict[int, Box] = {BBOX: layout.bbox}
        self.joined: set[tuple[int, int]] = set()

    def run(self) -> list[Joint]:
        steps = (self._ground_at_box, self._turn, self._ground_tilted, self._ground_waiting)
        while any(step() for step in steps):
            pass
        return self.lines

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
            line = squeeze(self.layout, self.standing, part, (BBOX, BBOX), TOP)
            return self._stand(part, [line or self._at_box(part, bottom)])
        point = bottom if bottom is not None else top
        if point is None:
            return False
        face = BOTTOM if bottom is not None else TOP
        waits = False
        for other in self.layout.neighbours(part):
            between = squeeze(self.layout, self.standing, part, (BBOX, other), face)
            if between is not None and other in self.standing:
                return self._stand(part, [between], other)
            waits |= between is not None
        return not waits and self._stand(part, [self._at_box(part, point)])

    def _turn(self) -> bool:
        """One turn over the aligned parts: what touches what stands is grounded, and all such contacts are written."""
        moved = False
        for part in range(len(self.layout.parts)):
            others = [other for other in self.layout.neighbours(part) if other in self.standing]
            if not self.layout.aligned(part):
                continue
            if part in self.standing:
                others = [other for other in others if _pair(part, other) not in self.joined]
                moved |= self._stand(part, [attach_contact(self.layout, self.standing, part, each) for each in others], *others)
            elif self.layout.bottoms[part] is None and self.layout.tops[part] is None and others:
                moved |= self._ground_between(part, others)
        return moved

    def _ground_between(self, part: int, others: list[int]) -> bool:
        """Grounds a part at its neighbours: by a squeeze, if two of them hold it at opposite faces."""
        for face in (LEFT, BOTTOM, BACK):
            for first in others:
                for second in others:
                    line = squeeze(self.layout, self.standing, part, (first, second), face) if first != second else None
                    if line is not None:
                        return self._stand(part, [line], first, second)
        lines: list[Joint] = [attach_contact(self.layout, self.standing, part, other) for other in others]
        return self._stand(part, lines, *others)

    def _ground_tilted(self) -> bool:
        for part in self._loose(aligned=False):
            placed = self.place_tilted(part, self.lines, self.standing)
            if placed is not None:
                lines, box = placed
                joined = self._stand(part, lines, *(each for each in self.layout.neighbours(part) if each in self.standing))
                self.standing[part] = box
                return joined
        return False

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
        return attach(self.layout, self.standing, part, BBOX, point, point)

    def _stand(self, part: int, lines: list[Joint], *others: int) -> bool:
        """Writes lines that ground or further join a part; whether there were any."""
        if lines:
            self.standing.setdefault(part, self.layout.parts[part].box)
            self.lines += lines
            self.joined |= {_pair(part, other) for other in others}
        return bool(lines)


def _pair(first: int, second: int) -> tuple[int, int]:
    return min(first, second), max(first, second)
