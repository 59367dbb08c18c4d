"""Order attachments so that each part is attached to grounded ones (shapeassembly §5.2, App. C)."""

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
    attach_contact,
    attach_line,
    squeeze,
)
from stages.shapeassembly.extraction.node_layout import BBOX_INDEX, NodeLayout
from stages.shapeassembly.syntax.program import Squeeze

MAX_GOOD_COST = 0.01
"""Cost up to which a tilted part is placed in canonical order; others wait for more parts to attach to."""


@dataclass(frozen=True)
class TiltedPlacement:
    """The placement of a tilted part.

    lines: the lines that ground it.
    box: the resulting box.
    cost: mean misplacement of its corners as a share of the bounding box's diagonal, plus a penalty for each line.
    """

    lines: tuple[Joint, ...]
    box: Box
    cost: float


TiltedPlacer = Callable[[int, list[Joint], PlacedBoxes], TiltedPlacement | None]
"""Places a tilted part:

given its index, the lines so far and the placed boxes. Returns None if it touches no placed part.
"""


MAX_JOINTS = 2
"""Attachments of one aligned part, as in the published programs: one to place it, one to keep it joined."""


def ground_parts(layout: NodeLayout, place_tilted: TiltedPlacer) -> list[Joint] | None:
    """Return the attach and squeeze lines of a node in grounded order, or None if a part has no path to the box.

    Aligned parts at the bounding box come first, then in turns aligned parts that touch placed ones, in canonical
    order. A part that can be squeezed waits for both partners, a tilted one for all aligned parts that can be placed
    without it. A second contact of an aligned part keeps parts together when numbers change.
    """
    return _Grounding(layout, place_tilted).run()


class _Grounding:
    """The lines so far, the placed boxes, and the pairs of parts that a line has joined."""

    def __init__(self, layout: NodeLayout, place_tilted: TiltedPlacer) -> None:
        self.layout = layout
        self.place_tilted = place_tilted
        self.lines: list[Joint] = []
        self.placed: dict[int, Box] = {BBOX_INDEX: layout.bbox}
        self.joined: set[tuple[int, int]] = set()
        self.joints = [0] * len(layout.parts)

    def run(self) -> list[Joint] | None:
        steps = (self._ground_at_box, self._turn, self._ground_waiting, self._ground_tilted)
        while any(step() for step in steps):
            pass
        return self.lines if len(self.placed) > len(self.layout.parts) else None

    def _ground_at_box(self) -> bool:
        """Ground aligned parts at the bounding box until all that are left there wait for a partner."""
        changed = False
        progress = True
        while progress:
            progress = False
            for part in self._loose(aligned=True):
                progress |= self._ground_one_at_box(part)
            changed |= progress
        return changed

    def _ground_one_at_box(self, part: int) -> bool:
        bottom, top = self.layout.bottoms[part], self.layout.tops[part]
        if bottom is not None and top is not None:
            line = squeeze(self.layout, self.placed, part, (BBOX_INDEX, BBOX_INDEX), TOP)
            return self._place(part, [line or self._at_box(part, bottom)])
        point = bottom if bottom is not None else top
        if point is None:
            return False
        face = BOTTOM if bottom is not None else TOP
        waits = False
        for other in self.layout.neighbours(part):
            if not self.layout.may_attach(part, other):
                continue
            between = squeeze(self.layout, self.placed, part, (BBOX_INDEX, other), face)
            if between is not None and other in self.placed:
                return self._place(part, [between], other)
            waits |= between is not None
        return not waits and self._place(part, [self._at_box(part, point)])

    def _turn(self) -> bool:
        """Ground, or join again, each aligned part that touches a placed one."""
        changed = False
        for part in range(len(self.layout.parts)):
            others = self._targets(part)
            if not others or not self.layout.aligned(part):
                continue
            if part in self.placed:
                changed |= self._join(part, others[: MAX_JOINTS - self.joints[part]])
            elif self.layout.bottoms[part] is None and self.layout.tops[part] is None:
                changed |= self._ground_between(part, others)
        return changed

    def _targets(self, part: int) -> list[int]:
        """Return the placed neighbours that a part may attach to, those at the centre of a face first."""
        others = [
            other
            for other in self.layout.neighbours(part)
            if other in self.placed and self.layout.may_attach(part, other) and _pair(part, other) not in self.joined
        ]
        return sorted(others, key=lambda other: (not self.layout.at_face_center(part, other), other))

    def _ground_between(self, part: int, others: list[int]) -> bool:
        """Ground a part at its neighbours: by a squeeze, if two of them hold opposite faces."""
        for face in (LEFT, BOTTOM, BACK):
            for first in others:
                for second in others:
                    line = squeeze(self.layout, self.placed, part, (first, second), face) if first != second else None
                    if line is not None:
                        return self._place(part, [line], first, second)
        return self._join(part, others[:MAX_JOINTS])

    def _join(self, part: int, others: list[int]) -> bool:
        return self._place(part, [attach_contact(self.layout, self.placed, part, other) for other in others], *others)

    def _ground_tilted(self) -> bool:
        """Ground the first tilted part with a good placement, or else the one with the best."""
        best: tuple[int, TiltedPlacement] | None = None
        for part in self._loose(aligned=False):
            placing = self.place_tilted(part, self.lines, self.placed)
            if placing is not None and (best is None or placing.cost < best[1].cost):
                best = (part, placing)
                if placing.cost <= MAX_GOOD_COST:
                    break
        if best is None:
            return False
        part, placing = best
        self._place(part, placing.lines, *(other for other in self.layout.neighbours(part) if other in self.placed))
        self.placed[part] = placing.box
        return True

    def _ground_waiting(self) -> bool:
        """Ground the first part at the bounding box that waits for a partner in vain."""
        for part in self._loose(aligned=True):
            for point in (self.layout.bottoms[part], self.layout.tops[part]):
                if point is not None:
                    return self._place(part, [self._at_box(part, point)])
        return False

    def _loose(self, *, aligned: bool) -> list[int]:
        parts = range(len(self.layout.parts))
        return [part for part in parts if part not in self.placed and self.layout.aligned(part) == aligned]

    def _at_box(self, part: int, point: FloatArray) -> Joint:
        return attach_line(self.layout, self.placed, part, BBOX_INDEX, point, point)

    def _place(self, part: int, lines: Sequence[Joint], *others: int) -> bool:
        """Add lines that ground or join a part. Returns whether there were any."""
        if lines:
            self.placed.setdefault(part, self.layout.parts[part].box)
            self.lines += lines
            self.joints[part] += sum(2 if isinstance(line, Squeeze) else 1 for line in lines)
            self.joined |= {_pair(part, other) for other in others}
        return bool(lines)


def _pair(first: int, second: int) -> tuple[int, int]:
    return min(first, second), max(first, second)
