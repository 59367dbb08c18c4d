"""Frames along a rail that roll as little as they can: double reflection (Wang et al. 2008), without a loop."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from stages.programs.curves.vectors import dots
from stages.shape.arrays import FloatArray

__all__ = ["rail_axes"]


def rail_axes(
    points: FloatArray, tangents: FloatArray, positions: FloatArray, closed: bool, up: npt.ArrayLike | None
) -> tuple[FloatArray, FloatArray]:
    """The axes x and y of a profile at each of n stations, float64 (n, 3) each; x cross y is the tangent.

    points, tangents: float64 (n, 3); positions: float64 (n,), relative arc length. At the first station y leans
    towards `up` (3,); None is the world's +y, or +z where the rail starts steeper than 45 degrees. From there on the
    frames do not roll about the tangent; on a closed rail what is left after a round is spread over its length.
    Raises ValueError where `up` runs along the rail.
    """
    first = _start_axis(tangents[0], up)
    change = tangents - tangents[0]
    if np.abs(change).max() < 1e-12:
        second = np.cross(tangents[0], first)
        return np.repeat(first[None], len(points), axis=0), np.repeat(second[None], len(points), axis=0)
    # Any axes will do to measure the roll against: transport turns each pair into the next by an angle, and the
    # angles add up.
    a, b = _any_axes(tangents)
    after, before = (np.roll(points, -1, axis=0), points) if closed else (points[1:], points[:-1])
    here, there = (tangents, np.roll(tangents, -1, axis=0)) if closed else (tangents[:-1], tangents[1:])
    next_a, next_b = (np.roll(a, -1, axis=0), np.roll(b, -1, axis=0)) if closed else (a[1:], b[1:])
    carried = _reflected_twice(a if closed else a[:-1], after - before, here, there)
    rolls = np.arctan2(dots(carried, next_b), dots(carried, next_a))
    angles = np.empty(len(points))
    angles[0] = np.arctan2(first @ b[0], first @ a[0])
    np.cumsum(rolls[: len(points) - 1], out=angles[1:])
    angles[1:] += angles[0]
    if closed:
        left = angles[-1] + rolls[-1] - angles[0]
        angles -= (left - 2.0 * np.pi * np.round(left / (2.0 * np.pi))) * positions
    cosine, sine = np.cos(angles)[:, None], np.sin(angles)[:, None]
    return cosine * a + sine * b, cosine * b - sine * a


def _start_axis(tangent: FloatArray, up: npt.ArrayLike | None) -> FloatArray:
    """The profile's x at the start."""
    if up is None:
        wanted = np.array([0.0, 0.0, 1.0]) if abs(tangent[1]) > 0.7072 else np.array([0.0, 1.0, 0.0])
    else:
        wanted = np.asarray(up, dtype=np.float64)
    x: FloatArray = np.cross(wanted, tangent)
    size = float(np.sqrt(x @ x))
    if size < 1e-6 * max(float(np.abs(wanted).max()), 1e-300):
        raise ValueError(f"up {wanted.tolist()} runs along the start of the rail: give a direction across it")
    return x / size


def _any_axes(tangents: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Two axes across each tangent, right-handed with it (Duff et al. 2017)."""
    x, y, z = tangents.T
    sign = np.where(z >= 0.0, 1.0, -1.0)
    p = -1.0 / (sign + z)
    q = x * y * p
    a, b = np.empty_like(tangents), np.empty_like(tangents)
    a[:, 0], a[:, 1], a[:, 2] = 1.0 + sign * x * x * p, sign * q, -sign * x
    b[:, 0], b[:, 1], b[:, 2] = q, sign + y * y * p, -y
    return a, b


def _reflected_twice(axes: FloatArray, steps: FloatArray, here: FloatArray, there: FloatArray) -> FloatArray:
    """`axes` (m, 3) across the tangents `here`, carried along `steps` to the tangents `there`."""
    twice = 2.0 / dots(steps, steps)
    axes = axes - (twice * dots(steps, axes))[:, None] * steps
    turned = here - (twice * dots(steps, here))[:, None] * steps
    mirror = there - turned
    carried: FloatArray = axes - (2.0 * dots(mirror, axes) / dots(mirror, mirror))[:, None] * mirror
    return carried
