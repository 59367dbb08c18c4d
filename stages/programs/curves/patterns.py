"""Copies: along a curve, in a row, around an axis, mirrored (geocode §3.1, "symmetries")."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Protocol, TypeVar

import numpy as np

from stages.programs.curves.curve import Axis
from stages.programs.curves.transforms import mirroring, rotation, translation
from stages.shape.arrays import FloatArray

Moved = TypeVar("Moved", bound="Movable")


class Movable(Protocol):
    """A part, a mesh or a curve."""

    def transformed(self: Moved, matrix: FloatArray) -> Moved: ...


def copies(elements: Sequence[Moved], poses: Iterable[FloatArray]) -> list[Moved]:
    """All elements at each of the poses (4, 4), such as the frames of a curve; labels are kept."""
    return [element.transformed(pose) for pose in poses for element in elements]


def evenly(count: int, start: float = 0.0, end: float = 1.0) -> FloatArray:
    """Relative positions of `count` copies from start to end, float64 (count,); a single one is in the middle."""
    return np.array([(start + end) / 2.0]) if count == 1 else np.linspace(start, end, count)


def linear(elements: Sequence[Moved], count: int, step: tuple[float, float, float]) -> list[Moved]:
    """`count` copies in a row, each `step` from the one before; the first is not moved."""
    return copies(elements, [translation(*(index * length for length in step)) for index in range(count)])


def radial(elements: Sequence[Moved], count: int, axis: Axis = "y", angle: float = 360.0) -> list[Moved]:
    """`count` copies around an axis through the origin; the first is not moved.

    Over 360 degrees they are evenly spaced; over a smaller `angle` the last is at its end.
    """
    gaps = count if abs(angle) >= 360.0 else max(count - 1, 1)
    return copies(elements, [rotation(axis, angle * index / gaps) for index in range(count)])


def symmetric(elements: Sequence[Moved], axis: Axis, at: float = 0.0) -> list[Moved]:
    """The elements, then their mirror images in the plane where the coordinate `axis` is `at`."""
    return [*elements, *copies(elements, [mirroring(axis, at)])]
