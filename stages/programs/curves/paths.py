"""Rails to sweep along and outlines to revolve: lines, Bezier chains, arcs, helices, spirals (geocode §3.1)."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from stages.programs.curves.curve import Axis, Curve, axis_index
from stages.shape.arrays import FloatArray


def polyline(points: npt.ArrayLike, closed: bool = False) -> Curve:
    """Straight pieces through points (n, 3), or (n, 2) in the plane z = 0; sweeps mitre the corners."""
    return Curve.through(points, closed)


def line(start: npt.ArrayLike, end: npt.ArrayLike) -> Curve:
    """The straight line between two points (3,)."""
    return Curve.through([np.asarray(start, dtype=np.float64), np.asarray(end, dtype=np.float64)])


def bezier(controls: npt.ArrayLike, count: int = 12, closed: bool = False) -> Curve:
    """A chain of cubic Bezier pieces of `count` segments each.

    controls: (3 m + 1, 3) or (3 m + 1, 2): point, handle, handle, point, handle, handle, point, ...; (3 m, 3) for a
    closed chain, without the last point

    Raises ValueError for another number of controls.
    """
    given = np.asarray(controls, dtype=np.float64)
    if closed and len(given):
        given = np.concatenate([given, given[:1]])
    if given.ndim != 2 or len(given) < 4 or len(given) % 3 != 1:
        raise ValueError(
            f"a Bezier chain of m pieces takes {'3 m' if closed else '3 m + 1'} controls "
            f"(point, handle, handle, point, ...), not {len(given) - closed}"
        )
    pieces = np.stack([given[:-1:3], given[1::3], given[2::3], given[3::3]], axis=1)
    points = (_bernstein(count) @ pieces)[:, :-1].reshape(-1, given.shape[1])
    return Curve.through(points if closed else np.concatenate([points, given[-1:]]), closed)


@lru_cache(maxsize=64)
def _bernstein(count: int) -> FloatArray:
    """Weights of the four controls at `count` + 1 even parameters, float64 (count + 1, 4)."""
    if count < 1:
        raise ValueError(f"a Bezier piece needs at least 1 segment, not {count}")
    t = np.linspace(0.0, 1.0, count + 1)
    s = 1.0 - t
    return np.stack([s**3, 3.0 * s * s * t, 3.0 * s * t * t, t**3], axis=1)


def arc(radius: float, start: float = 0.0, end: float = 360.0, axis: Axis = "y", count: int = 24) -> Curve:
    """An arc around an axis through the origin, `count` segments from angle `start` to `end` in degrees.

    Angles run counter-clockwise seen from the axis' tip, as in `rotation` and `radial`: around y, 0 is +x and 90 is -z;
    around z, +x and +y; around x, +y and +z. A full turn is a closed curve.
    Raises ValueError unless the radius is above 0 and the angles differ by at most 360.
    """
    if radius <= 0.0 or not 0.0 < abs(end - start) <= 360.0 + 1e-9:
        raise ValueError(f"an arc needs a radius above 0 and up to 360 degrees, not {radius:g} and {end - start:g}")
    whole = abs(end - start) >= 360.0 - 1e-9
    angles = np.radians(np.linspace(start, end, count + 1))[: count if whole else count + 1]
    return Curve.through(_turned(np.full(len(angles), radius), angles, np.zeros(len(angles)), axis), closed=whole)


def helix(radius: float, height: float, turns: float, axis: Axis = "y", count: int = 16) -> Curve:
    """A helix from angle 0 at the origin's level up to `height` along the axis; `count` segments per turn.

    Negative turns are clockwise. Raises ValueError unless radius and turns differ from 0.
    """
    if radius <= 0.0 or turns == 0.0:
        raise ValueError(f"a helix needs a radius above 0 and some turns, not {radius:g} and {turns:g}")
    t = np.linspace(0.0, 1.0, max(int(np.ceil(abs(turns) * count)), 2) + 1)
    return Curve.through(_turned(np.full(len(t), radius), 2.0 * np.pi * turns * t, height * t, axis))


def spiral(inner: float, outer: float, turns: float, axis: Axis = "y", count: int = 16) -> Curve:
    """A flat spiral from one radius to another; `count` segments per turn. Raises ValueError for equal radii."""
    if min(inner, outer) < 0.0 or inner == outer or turns == 0.0:
        raise ValueError(f"a spiral needs two different radii, not {inner:g} and {outer:g}, and some turns")
    t = np.linspace(0.0, 1.0, max(int(np.ceil(abs(turns) * count)), 2) + 1)
    return Curve.through(_turned(inner + (outer - inner) * t, 2.0 * np.pi * turns * t, np.zeros(len(t)), axis))


def chain(*curves: Curve) -> Curve:
    """Join open curves in order; straight pieces bridge the gaps."""
    if any(curve.closed for curve in curves):
        raise ValueError("a closed curve has no end to chain another to: take a part() of it")
    return Curve.through(np.concatenate([curve.points for curve in curves]))


def _turned(radii: FloatArray, angles: FloatArray, heights: FloatArray, axis: Axis) -> FloatArray:
    """Points at radii and angles around an axis, at heights along it, float64 (n, 3)."""
    first, second, sense = {0: (1, 2, 1.0), 1: (0, 2, -1.0), 2: (0, 1, 1.0)}[axis_index(axis)]
    points = np.empty((len(angles), 3))
    points[:, first], points[:, second] = radii * np.cos(angles), sense * radii * np.sin(angles)
    points[:, axis_index(axis)] = heights
    return points
