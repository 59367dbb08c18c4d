"""Clouds as a network sees them: normalized and subsampled."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from stages.shape.arrays import FloatArray


@dataclass(frozen=True)
class Frame:
    """The position and the size of a cloud: `(points - centre) / size` is in the box from -0.5 to 0.5."""

    centre: FloatArray
    size: float

    def normalized(self, points: FloatArray) -> FloatArray:
        """Points (n, 3) in the frame."""
        return (points - self.centre) / self.size

    def placed(self, points: FloatArray) -> FloatArray:
        """Points (n, 3) of the frame in the cloud's coordinates."""
        return points * self.size + self.centre

    def is_like(self, other: Frame) -> bool:
        """Whether the frames differ by no more than a ten thousandth of the size."""
        tolerance = 1e-4 * self.size
        same_size = abs(self.size - other.size) <= tolerance
        return same_size and bool(np.abs(self.centre - other.centre).max() <= tolerance)


def frame_of(points: FloatArray) -> Frame:
    """The frame of points (n, 3): middle and longest side of their bounding box."""
    low, high = points.min(axis=0), points.max(axis=0)
    return Frame((low + high) / 2.0, float((high - low).max()) or 1.0)


def subsample(points: FloatArray, n: int, rng: np.random.Generator) -> FloatArray:
    """`n` random points of (m, 3); none is repeated before all are drawn."""
    whole, rest = divmod(n, len(points))
    chosen: list[npt.NDArray[np.int64]] = [np.arange(len(points))] * whole
    chosen.append(rng.choice(len(points), rest, replace=False, shuffle=False))
    return points[np.concatenate(chosen)]
