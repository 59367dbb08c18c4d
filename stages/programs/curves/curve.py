"""A curve in space: points, tangents and frames at any relative position (geocode §3.1, "curve sampling")."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from stages.programs.curves.frames import rail_axes
from stages.programs.curves.vectors import unit
from stages.shape.arrays import BoolArray, FloatArray

Axis = Literal["x", "y", "z"]

MAX_CORNER_COSINE = np.cos(np.radians(30.0))
"""A turn by more than 30 degrees at a point is a corner; else the curve is smooth there."""

REVERSAL_TOLERANCE = 1e-6
"""Segments whose directions are opposite up to this difference of their dot product have no mitre plane."""

MAX_MITRE_RATIO = 4.0
"""Beyond a turn of 151 degrees, the tip of a swept corner is blunt."""


def axis_index(axis: Axis) -> int:
    """0, 1 or 2. Raises ValueError for another name."""
    index = "xyz".find(axis)
    if len(axis) != 1 or index < 0:
        raise ValueError(f"axis {axis!r} must be 'x', 'y' or 'z'")
    return index


class Stations(NamedTuple):
    """Positions of the rings of a sweep.

    positions: float64 (n,), relative arc length
    points, tangents: float64 (n, 3)
    fold: float64 (n, 3), direction in which a ring is stretched at a corner, so that the pieces keep their width
    excess: float64 (n,), factor of that stretch, minus 1
    """

    positions: FloatArray
    points: FloatArray
    tangents: FloatArray
    fold: FloatArray
    excess: FloatArray


@dataclass(frozen=True, eq=False)
class Curve:
    """A curve through points, straight in between.

    points: float64 (n, 3), neighbours distinct; the first is not repeated where the curve is `closed`

    Positions are relative arc length: 0 is the start, 1 the end; modulo 1 for a closed curve. Sampled points are on the
    segments that are swept, so attachments are exactly within the mesh.

    Make curves with `polyline`, `line`, `bezier`, `arc`, `helix`, `spiral`, which check their points.
    """

    points: FloatArray
    closed: bool = False

    @staticmethod
    def through(points: npt.ArrayLike, closed: bool = False) -> Curve:
        """The curve through points (n, 3), or (n, 2) in the plane z = 0. Coincident neighbours count once.

        Raises ValueError for fewer than two (closed: three) distinct points, for numbers that are not finite, and where
        the curve turns back onto itself.
        """
        given = np.asarray(points, dtype=np.float64)
        if given.ndim != 2 or given.shape[1] not in (2, 3) or not np.isfinite(given).all():
            raise ValueError(f"a curve needs finite points of shape (n, 3) or (n, 2), these are {given.shape}")
        if given.shape[1] == 2:
            given = np.column_stack([given, np.zeros(len(given))])
        lengths = Curve(given, closed)._measured[1] if len(given) > 1 else None
        if lengths is not None and lengths.min() <= 1e-9 * lengths.sum():
            distinct = lengths > 1e-9 * lengths.sum()
            given = given[distinct if closed else np.concatenate([distinct, [True]])]
        if len(given) < (3 if closed else 2):
            kind = "closed curve needs three" if closed else "curve needs two"
            raise ValueError(f"a {kind} distinct points and has {len(given)}: move its points apart")
        curve = Curve(given, closed)
        turns = curve._measured[2]
        if turns.min() < REVERSAL_TOLERANCE - 1.0:
            index = int(turns.argmin())
            raise ValueError(f"the curve turns back onto itself at point {index}: move that point aside, or end there")
        return curve

    @cached_property
    def _measured(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Direction (m, 3), length (m,), and cosine of the turn before it (m,), of each segment; no turn is 1."""
        from stages.programs.curves.kernels import measure

        directions, lengths, turns = measure(self.points, self.closed)
        return directions, lengths, turns

    @cached_property
    def _reached(self) -> FloatArray:
        """Arc length at the start of each segment and at the end of the last, (m + 1,)."""
        reached = np.zeros(len(self._measured[1]) + 1)
        np.cumsum(self._measured[1], out=reached[1:])
        return reached

    @property
    def length(self) -> float:
        """Arc length."""
        return float(self._reached[-1])

    @cached_property
    def positions(self) -> FloatArray:
        """Relative position of each point, float64 (n,), from 0; an open curve ends at 1."""
        relative: FloatArray = self._reached[: len(self.points)] / self._reached[-1]
        return relative

    @cached_property
    def corners(self) -> BoolArray:
        """Whether the curve has a corner (turns by more than 30 degrees) at each point, bool (n,)."""
        sharp: BoolArray = self._measured[2] < MAX_CORNER_COSINE
        return sharp if self.closed else np.concatenate([sharp, [False]])

    @cached_property
    def own_stations(self) -> Stations:
        """The stations at the curve's own points. A tangent halves the turn between its two segments."""
        from stages.programs.curves.kernels import halve_turns

        directions, _, turns = self._measured
        return Stations(self.positions, self.points, *halve_turns(directions, turns, self.closed, MAX_MITRE_RATIO))

    def stations(self, positions: npt.ArrayLike) -> Stations:
        """The stations at relative positions (k,). Between smooth points the tangent turns evenly.

        Raises ValueError for positions outside 0 to 1 on an open curve.
        """
        where = np.atleast_1d(np.asarray(positions, dtype=np.float64))
        if self.closed:
            where = where % 1.0
        elif where.size and (where.min() < -1e-9 or where.max() > 1.0 + 1e-9):
            raise ValueError(f"position {where[np.argmax(np.abs(where - 0.5))]:g} is outside the curve, 0 to 1")
        directions, lengths, _ = self._measured
        own = self.own_stations
        distance = np.clip(where, 0.0, 1.0) * self._reached[-1]
        segment = np.clip(np.searchsorted(self._reached, distance, side="right") - 1, 0, len(lengths) - 1)
        share = (distance - self._reached[segment]) / lengths[segment]
        points = self.points[segment] + (share * lengths[segment])[:, None] * directions[segment]
        following = (segment + 1) % len(self.points)
        sharp = self.corners
        leaving = np.where(sharp[segment, None], directions[segment], own.tangents[segment])
        arriving = np.where(sharp[following, None], directions[segment], own.tangents[following])
        tangents = unit(leaving + share[:, None] * (arriving - leaving))
        fold, excess = np.zeros_like(points), np.zeros(len(points))
        nearest = np.where(share < 0.5, segment, following)
        there = np.minimum(share, 1.0 - share) < 1e-7
        at = nearest[there]
        points[there], tangents[there] = own.points[at], own.tangents[at]
        fold[there], excess[there] = own.fold[at], own.excess[at]
        return Stations(where, points, tangents, fold, excess)

    def at(self, positions: npt.ArrayLike) -> FloatArray:
        """Points at relative positions: float64 (3,) for a number, (k, 3) for k of them."""
        points = self.stations(positions).points
        return points[0] if np.ndim(positions) == 0 else points

    def tangents(self, positions: npt.ArrayLike) -> FloatArray:
        """Unit tangents at relative positions: float64 (3,) for a number, (k, 3) for k of them."""
        tangents = self.stations(positions).tangents
        return tangents[0] if np.ndim(positions) == 0 else tangents

    def frames(self, positions: npt.ArrayLike, up: npt.ArrayLike | None = None) -> FloatArray:
        """Frames at relative positions, float64 (4, 4) for a number, (k, 4, 4) for k of them.

        Columns: the profile's x, the profile's y, the tangent, the point. A sweep with the same `up` has the same
        frames: they roll as little as possible from the start on.
        """
        wanted = np.atleast_1d(np.asarray(positions, dtype=np.float64))
        if self.closed:
            wanted = wanted % 1.0
        sampled, inverse = np.unique(np.concatenate([self.positions, wanted]), return_inverse=True)
        stations = self.stations(sampled)
        x, y = rail_axes(stations.points, stations.tangents, sampled, self.closed, up)
        at = inverse[len(self.positions) :]
        frames = np.zeros((len(wanted), 4, 4))
        frames[:, :3, 0], frames[:, :3, 1] = x[at], y[at]
        frames[:, :3, 2], frames[:, :3, 3] = stations.tangents[at], stations.points[at]
        frames[:, 3, 3] = 1.0
        return frames[0] if np.ndim(positions) == 0 else frames

    def position_where(self, axis: Axis, value: float) -> float:
        """The first relative position at which a coordinate has a value, such as the height of a rail on a leg.

        Raises ValueError where it never has it.
        """
        along = self.points[:, axis_index(axis)] - value
        after = np.roll(along, -1) if self.closed else along[1:]
        before = along if self.closed else along[:-1]
        crossed = np.flatnonzero((before * after <= 0.0) & ((before != after) | (before == 0.0)))
        if len(crossed) == 0:
            low, high = along.min() + value, along.max() + value
            raise ValueError(f"the curve's {axis} is never {value:g}: it goes from {low:g} to {high:g}")
        first = int(crossed[0])
        share = 0.0 if before[first] == after[first] else before[first] / (before[first] - after[first])
        return float((self._reached[first] + share * self._measured[1][first]) / self._reached[-1])

    def part(self, start: float, end: float) -> Curve:
        """The piece from one relative position to a later one, an open curve. Raises ValueError unless start < end."""
        if not 0.0 <= start < end <= 1.0:
            raise ValueError(
                f"a piece runs from a position to a later one within 0 to 1, not from {start:g} to {end:g}"
            )
        inner = self.positions[(self.positions > start) & (self.positions < end)]
        ends = self.at([start, min(end, 1.0)]) if not self.closed or end < 1.0 else self.at([start, 0.0])
        return Curve.through(np.concatenate([ends[:1], self.at(inner), ends[1:]]))

    def reversed(self) -> Curve:
        """The curve in the opposite direction; a closed one starts at the same point."""
        backwards = self.points[::-1]
        return Curve(np.roll(backwards, 1, axis=0) if self.closed else backwards, self.closed)

    def transformed(self, matrix: FloatArray) -> Curve:
        """The curve moved by an affine matrix (4, 4)."""
        return Curve.through(self.points @ matrix[:3, :3].T + matrix[:3, 3], self.closed)
