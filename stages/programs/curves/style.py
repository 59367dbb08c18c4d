"""A style: the scale and the twist of a profile along its rail (geocode §3.1, "triplets")."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from stages.shape.arrays import FloatArray

Scale = float | tuple[float, float]
"""One scale for both axes of the profile, or one for x and one for y."""


@dataclass(frozen=True, eq=False)
class Style:
    """Scale and twist at relative positions, linear in between.

    positions: float64 (k,), from 0 to 1, rising; a sweep has a ring at each of them
    scale: float64 (k, 2), of the profile's x and y, not negative; 0 for both at an end closes the mesh in a point
    twist: float64 (k,), degrees about the rail, counter-clockwise
    """

    positions: FloatArray
    scale: FloatArray
    twist: FloatArray

    def __post_init__(self) -> None:
        positions = self.positions
        if len(positions) < 2 or positions[0] != 0.0 or positions[-1] != 1.0 or (np.diff(positions) <= 0.0).any():
            raise ValueError(f"a style's positions rise from 0 to 1, unlike {positions.tolist()}")
        if self.scale.shape != (len(positions), 2) or self.twist.shape != positions.shape:
            raise ValueError(f"a style of {len(positions)} positions needs as many scales (x, y) and twists")
        if not (self.scale.min() >= 0.0 and np.isfinite(self.scale).all() and np.isfinite(self.twist).all()):
            raise ValueError("a style's scales are finite and not negative, its twists finite")

    @staticmethod
    def taper(start: Scale, end: Scale, twist: float = 0.0, count: int = 1) -> Style:
        """Linear from one scale to another, with `twist` degrees in `count` steps."""
        t = np.linspace(0.0, 1.0, count + 1)
        a, b = np.broadcast_to(start, 2), np.broadcast_to(end, 2)
        return Style(t, a + t[:, None] * (b - a), twist * t)

    @staticmethod
    def knots(knots: Sequence[tuple[float, Scale]], smooth: bool = False, count: int = 12, twist: float = 0.0) -> Style:
        """Through `(position, scale)` pairs from position 0 to 1, straight or smooth.

        A smooth style has `count` even steps besides its knots, and does not overshoot them.
        """
        positions = np.array([position for position, _ in knots], dtype=np.float64)
        scales = np.array([np.broadcast_to(scale, 2) for _, scale in knots], dtype=np.float64)
        if not smooth:
            return Style(positions, scales, twist * positions)
        style = Style(positions, scales, twist * positions)
        t = np.unique(np.concatenate([positions, np.linspace(0.0, 1.0, count + 1)]))
        return Style(t, _monotone(t, positions, style.scale), twist * t)

    @staticmethod
    def of(scale: Callable[[FloatArray], npt.ArrayLike], count: int = 16, twist: float = 0.0) -> Style:
        """Sample a function from positions (k,) to scales (k,) or (k, 2), at `count` even steps.

        `Style.of(lambda t: 1 + 0.1 * np.sin(8 * np.pi * t), count=48)` is a leg with four waves.
        """
        t = np.linspace(0.0, 1.0, count + 1)
        scales = np.asarray(scale(t), dtype=np.float64)
        return Style(t, np.array(np.broadcast_to(scales.T, (2, len(t))).T), twist * t)

    def at(self, positions: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Scale (n, 2) and twist in degrees (n,) at relative positions (n,)."""
        scale = np.empty((len(positions), 2))
        scale[:, 0] = np.interp(positions, self.positions, self.scale[:, 0])
        scale[:, 1] = np.interp(positions, self.positions, self.scale[:, 1])
        return scale, np.interp(positions, self.positions, self.twist)


def _monotone(t: FloatArray, positions: FloatArray, values: FloatArray) -> FloatArray:
    """Cubic pieces through values (k, 2) at positions (k,) that never overshoot (Fritsch, Butland 1984)."""
    widths = np.diff(positions)[:, None]
    rises = np.diff(values, axis=0) / widths
    slopes = np.concatenate([rises[:1], np.zeros((len(values) - 2, 2)), rises[-1:]])
    together = rises[:-1] * rises[1:]
    same = together > 0.0
    slopes[1:-1][same] = 2.0 * together[same] / (rises[:-1] + rises[1:])[same]
    k = np.clip(np.searchsorted(positions, t, side="right") - 1, 0, len(positions) - 2)
    u = ((t - positions[k]) / widths[k, 0])[:, None]
    bend = u * u * (3.0 - 2.0 * u)
    leave, arrive = u * (1.0 - u) ** 2, u * u * (u - 1.0)
    through: FloatArray = (
        values[k] + bend * (values[k + 1] - values[k]) + widths[k] * (leave * slopes[k] + arrive * slopes[k + 1])
    )
    # Rounding must not make a scale negative.
    return np.maximum(through, 0.0)
