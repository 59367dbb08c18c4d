"""Closed plane profiles: square to circle by one parameter, superellipses, polygons, custom ones (geocode §3.1)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
import numpy.typing as npt

from stages.programs.curves.caps import Cap, polygon_cap
from stages.programs.curves.curve import Axis, Curve, axis_index
from stages.shape.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class Profile:
    """A closed curve in the plane.

    points: float64 (k, 2), counter-clockwise, the first not repeated; the rail is at the origin
    """

    points: FloatArray

    @staticmethod
    def of(points: npt.ArrayLike) -> Profile:
        """A custom profile from points (k, 2) in either direction; it may be concave but not intersect itself.

        Coincident neighbours count once. Raises ValueError for fewer than three points, no area, and crossings.
        """
        given = np.asarray(points, dtype=np.float64)
        if given.ndim != 2 or given.shape[1] != 2 or not np.isfinite(given).all():
            raise ValueError(f"a profile needs finite points of shape (k, 2), these are {given.shape}")
        size = float(np.ptp(given, axis=0).max()) if len(given) else 0.0
        given = given[np.abs(given - np.roll(given, 1, axis=0)).max(axis=1) > 1e-9 * size]
        area = _area(given)
        if len(given) < 3 or abs(area) < 1e-9 * size * size:
            raise ValueError(f"a profile of {len(given)} distinct points has no area: move its points apart")
        crossing = _crossing(given)
        if crossing is not None:
            raise ValueError(f"the profile crosses itself: its sides {crossing[0]} and {crossing[1]} meet")
        return Profile(given if area > 0.0 else given[::-1])

    def __len__(self) -> int:
        return len(self.points)

    @property
    def area(self) -> float:
        """Enclosed area."""
        return _area(self.points)

    @property
    def size(self) -> FloatArray:
        """Width and height of its bounding box, float64 (2,)."""
        extent: FloatArray = self.points.max(axis=0) - self.points.min(axis=0)
        return extent

    @cached_property
    def cap(self) -> Cap:
        """The faces that fill the profile."""
        return polygon_cap(self.points)

    def scaled(self, x: float, y: float | None = None) -> Profile:
        """Scaled by x and y, or by x alone. Raises ValueError unless both are above 0."""
        factors = np.array([x, x if y is None else y])
        if factors.min() <= 0.0:
            raise ValueError(f"a profile's scale is above 0, not {factors.tolist()}")
        return Profile(self.points * factors)

    def translated(self, x: float, y: float) -> Profile:
        """Moved away from the rail."""
        return Profile(self.points + np.array([x, y]))

    def rotated(self, degrees: float) -> Profile:
        """Rotated counter-clockwise about the rail."""
        angle = np.radians(degrees)
        rotation = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        return Profile(self.points @ rotation)

    def inset(self, width: float) -> Profile:
        """The profile with each side moved inwards by `width` (outwards where it is negative), as many points.

        Raises ValueError where a side would vanish.
        """
        before, after = np.roll(self.points, 1, axis=0), np.roll(self.points, -1, axis=0)
        arriving, leaving = self.points - before, after - self.points
        arriving /= np.hypot(arriving[:, 0], arriving[:, 1])[:, None]
        leaving /= np.hypot(leaving[:, 0], leaving[:, 1])[:, None]
        inwards = np.stack([-(arriving + leaving)[:, 1], (arriving + leaving)[:, 0]], axis=1)
        reach = 2.0 / np.maximum((inwards * inwards).sum(axis=1), 0.1)
        moved = self.points + width * reach[:, None] * inwards
        if (((np.roll(moved, -1, axis=0) - moved) * leaving).sum(axis=1) <= 0.0).any():
            raise ValueError(f"an inset of {width:g} is more than a side of the profile can give: use less")
        return Profile(moved)

    def curve(self, axis: Axis = "y", height: float = 0.0) -> Curve:
        """The profile as a closed curve in the plane across an axis, such as the outline of a seat to stand legs on.

        Across y the profile's x and y are the world's x and z; across z, x and y; across x, y and z.
        """
        plane = {0: (1, 2), 1: (0, 2), 2: (0, 1)}[axis_index(axis)]
        points = np.full((len(self.points), 3), float(height))
        points[:, plane] = self.points
        return Curve.through(points, closed=True)


def square_circle(roundness: float, width: float = 1.0, height: float | None = None, count: int = 16) -> Profile:
    """From a rectangle (roundness 0) to an ellipse (roundness 1) in the same box, smoothly in between.

    `height` None is `width`. All of one `count` (a multiple of 4) have their points at the same angles, so they can be
    lofted into each other. Raises ValueError for a roundness outside 0 to 1.
    """
    if not 0.0 <= roundness <= 1.0:
        raise ValueError(f"a roundness goes from 0 (square) to 1 (circle), {roundness:g} does not")
    return superellipse(width, height, 2.0 / roundness if roundness > 0.0 else np.inf, count)


def superellipse(width: float, height: float | None = None, exponent: float = 4.0, count: int = 16) -> Profile:
    """|2x / width|^e + |2y / height|^e = 1: 1 is a diamond, 2 an ellipse, infinity a rectangle.

    Raises ValueError unless sizes are above 0, the exponent is at least 1 and the count a multiple of 4.
    """
    size = np.array([width, width if height is None else height])
    if not size.min() > 0.0:
        raise ValueError(f"a profile's width and height are above 0, not {size.tolist()}")
    return Profile(_unit_superellipse(float(exponent), count) * (size / 2.0))


@lru_cache(maxsize=4096)
def _unit_superellipse(exponent: float, count: int) -> FloatArray:
    """The superellipse in the square from -1 to 1 at even angles from 45 degrees on, float64 (count, 2)."""
    if not exponent >= 1.0 or count < 4 or count % 4:
        raise ValueError(f"a superellipse needs an exponent from 1 and 4, 8, 12, ... points, not {exponent}, {count}")
    angles = np.pi / 4.0 + 2.0 * np.pi * np.arange(count) / count
    ray = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    across = np.abs(ray)
    longest = across.max(axis=1)
    if np.isinf(exponent):
        # The cosine of 45 degrees is not quite its sine: what lies on a side lies there exactly.
        points: FloatArray = np.where(across >= (1.0 - 1e-12) * longest[:, None], np.sign(ray), ray / longest[:, None])
    else:
        reach = longest * (((across / longest[:, None]) ** exponent).sum(axis=1)) ** (1.0 / exponent)
        points = ray / reach[:, None]
    points.flags.writeable = False
    return points


def circle(radius: float, count: int = 16) -> Profile:
    """A circle; `count` a multiple of 4."""
    return superellipse(2.0 * radius, None, 2.0, count)


def rectangle(width: float, height: float | None = None) -> Profile:
    """A rectangle of four points around the origin."""
    return superellipse(width, height, np.inf, 4)


def rounded_rectangle(width: float, height: float, radius: float, steps: int = 3) -> Profile:
    """A rectangle with corners of a true radius, `steps` sides each; radius 0 is the plain rectangle of four points.

    Raises ValueError for a radius below 0 or above half the shorter side.
    """
    shorter = min(width, height)
    if not 0.0 <= radius <= shorter / 2.0 * (1.0 + 1e-9):
        raise ValueError(f"a corner radius lies within 0 and half the shorter side, {shorter / 2:g}; not {radius:g}")
    if radius < 1e-9 * shorter:
        return rectangle(width, height)
    around = np.radians(np.arange(4)[:, None] * 90.0 + np.linspace(0.0, 90.0, steps + 1)).ravel()
    corner = np.repeat([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]], steps + 1, axis=0)
    middle = corner * (np.array([width, height]) / 2.0 - radius)
    points = middle + radius * np.stack([np.cos(around), np.sin(around)], axis=1)
    if radius > shorter / 2.0 * (1.0 - 1e-6):
        return Profile.of(points)
    return Profile(points)


def polygon(sides: int, radius: float) -> Profile:
    """A regular polygon with a side at the bottom, corners at `radius`. Raises ValueError for fewer than 3 sides."""
    if sides < 3 or not radius > 0.0:
        raise ValueError(f"a polygon needs 3 sides and a radius above 0, not {sides} and {radius:g}")
    angles = -np.pi / 2.0 + np.pi / sides + 2.0 * np.pi * np.arange(sides) / sides
    return Profile(radius * np.stack([np.cos(angles), np.sin(angles)], axis=1))


def _area(points: FloatArray) -> float:
    x, y = points.T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2.0


def _crossing(points: FloatArray) -> tuple[int, int] | None:
    """The indices of two sides that intersect and are no neighbours."""
    after = np.roll(points, -1, axis=0)

    def side_of(p: FloatArray, q: FloatArray, r: FloatArray) -> FloatArray:
        sides: FloatArray = (q[..., 0] - p[..., 0]) * (r[..., 1] - p[..., 1]) - (q[..., 1] - p[..., 1]) * (
            r[..., 0] - p[..., 0]
        )
        return sides

    a, b = points[:, None], after[:, None]
    c, d = points[None], after[None]
    meets = (side_of(a, b, c) * side_of(a, b, d) <= 0.0) & (side_of(c, d, a) * side_of(c, d, b) <= 0.0)
    # Distant collinear sides pass the test above.
    low, high = np.minimum(a, b), np.maximum(a, b)
    meets &= ((low <= np.maximum(c, d)) & (np.minimum(c, d) <= high)).all(axis=-1)
    indices = np.arange(len(points))
    steps = np.abs(indices[:, None] - indices)
    pairs = np.argwhere(meets & (steps > 1) & (steps < len(points) - 1))
    return (int(pairs[0, 0]), int(pairs[0, 1])) if len(pairs) else None
