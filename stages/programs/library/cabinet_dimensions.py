"""The dimensions of a cabinet: sizes in metres, the columns and which of them are open."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from stages.programs.curves import QuadMesh, box
from stages.programs.schema import Values

FRONT_THICKNESS = 0.03
"""Of doors and drawer fronts, in metres."""

CROWN_HEIGHT = 0.06
"""In metres."""


@dataclass(frozen=True)
class Opening:
    """A column between its boards, or a piece of it, that a front closes. low, high: corners (x, y)."""

    low: tuple[float, float]
    high: tuple[float, float]

    @property
    def size(self) -> tuple[float, float]:
        """Width and height."""
        return self.high[0] - self.low[0], self.high[1] - self.low[1]

    def grown(self, left: float, bottom: float, right: float, top: float) -> Opening:
        """The opening with its sides moved outwards."""
        return Opening((self.low[0] - left, self.low[1] - bottom), (self.high[0] + right, self.high[1] + top))

    def split(self, level: float) -> tuple[Opening, Opening]:
        """The pieces below and above a height."""
        return Opening(self.low, (self.high[0], level)), Opening((self.low[0], level), self.high)


class CabinetDimensions:
    """The sizes of the cabinet at `values`, in metres.

    board: thickness of the boards
    half: half the width without the top
    back, front: z of the ends of the case
    face: z of the front side of the fronts
    floor, ceiling: heights of the lower side of the case and of the upper end of its sides
    crown: height of the crown, 0 without
    """

    def __init__(self, values: Values) -> None:
        self.values = values
        self.board = values["board_thickness"]
        self.count = int(values["column_count"])
        self.half = (self.count * values["column_width"] + (self.count + 1) * self.board) / 2.0
        self.front = values["depth"] / 2.0
        self.back = -self.front
        self.face = self.front + (0.0 if values["has_inset_fronts"] else FRONT_THICKNESS)
        self.floor = values["base_height"]
        self.crown = CROWN_HEIGHT if values["has_crown"] else 0.0
        self.ceiling = values["height"] - values["top_thickness"] - self.crown

    @cached_property
    def columns(self) -> list[Opening]:
        """The columns from left to right."""
        width = self.values["column_width"]
        lefts = [column * (width + self.board) + self.board - self.half for column in range(self.count)]
        return [Opening((left, self.floor + self.board), (left + width, self.ceiling)) for left in lefts]

    @cached_property
    def is_open(self) -> list[bool]:
        """Whether each column has no fronts: those nearest to the middle are open, the right one of two first."""
        from_middle = sorted(range(self.count), key=lambda column: (abs(2 * column - self.count + 1), -column))
        open_columns = from_middle[: self.values["open_columns"]]
        return [column in open_columns for column in range(self.count)]


def block(low: tuple[float, float, float], high: tuple[float, float, float]) -> QuadMesh:
    """The box between two corners."""
    size = [b - a for a, b in zip(low, high, strict=True)]
    return box(size, [(a + b) / 2.0 for a, b in zip(low, high, strict=True)])
