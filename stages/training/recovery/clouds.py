"""Clouds as a network sees them: brought to one place and size."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from stages.shape.arrays import FloatArray


@dataclass(frozen=True)
class Frame:
    """Where a cloud stands: `(points - centre) / size` lies in the box from -0.5 to 0.5."""

    centre: FloatArray
    size: float

    def normalized(self, points: FloatArray) -> FloatArray:
        """Points (n, 3) in the frame."""
        return (points - self.centre) / self.size

    def placed(self, points: FloatArray) -> FloatArray:
        """Points (n, 3) of the frame where the cloud stands."""
        return points * self.size + self.centre

    def is_like(self, other: Frame) -> bool:
        """Whether it is the other but for a ten thousandth of its size."""
        near = 1e-4 * self.size
        return abs(self.size - other.size) <= near and bool(np.abs(self.centre - other.centre).max() <= near)


def frame_of(points: FloatArray) -> Frame:
    """The frame of points (n, 3): the middle and the longest side of the box around them."""
    low, high = points.min(axis=0), points.max(axis=0)
    return Frame((low + high) / 2.0, float((high - low).max()) or 1.0)


def subsample(points: FloatArray, n: int, rng: np.random.Generator) -> FloatArray:
    """`n` of some points (m, 3) at random, none twice before all are taken."""
    whole, rest = divmod(n, len(points))
    chosen: list[npt.NDArray[np.int64]] = [np.arange(len(points))] * whole
    chosen.append(rng.choice(len(points), rest, replace=False, shuffle=False))
    return points[np.concatenate(chosen)]
