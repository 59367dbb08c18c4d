"""The wall of a vessel: an inner outline, an outer one at constant distance, and meshes with one cross-section."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
import numpy.typing as npt

from stages.programs.curves import QuadMesh, loft_rings
from stages.shape.arrays import FloatArray

SEGMENTS_PER_EIGHTH = 6
"""From the middle of a side to a corner."""


@dataclass(frozen=True)
class VesselSection:
    """A vessel from above: from a square with soft corners (roundness 0) to a circle (1)."""

    roundness: float

    @property
    def _shape(self) -> float:
        return 0.16 + 0.84 * self.roundness

    def around(self, outline: npt.ArrayLike, ring: bool = False) -> QuadMesh:
        """The mesh of an outline (n, 2), radius and height, around the y axis.

        A solid, from its foot up the outer side, with poles or flat ends; or, for a closed outline, a `ring`.
        """
        points = np.asarray(outline, dtype=np.float64)
        rings = points[:, None, :1] * _directions(self._shape)
        rings[..., 1] = points[:, 1:]
        return loft_rings(rings, closed=ring)

    def reach(self, angle: npt.ArrayLike) -> FloatArray:
        """Radius in a direction, as a multiple of half the width; degrees from +x towards -z."""
        return _reach(np.radians(np.asarray(angle, dtype=np.float64)), 2.0 / self._shape)


@lru_cache(maxsize=64)
def _directions(shape: float) -> FloatArray:
    """A ring of half-width 1, counter-clockwise seen from above, float64 (k, 3).

    A superellipse with points spaced evenly, half by length and half by turning.
    """
    exponent = 2.0 / shape
    angles = np.linspace(0.0, np.pi / 4.0, 65)
    points = _superellipse(angles, exponent)
    length = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    turning = np.arctan2(np.sin(angles) ** (exponent - 1.0), np.cos(angles) ** (exponent - 1.0))
    eighth = np.interp(
        np.linspace(0.0, 2.0, SEGMENTS_PER_EIGHTH + 1), length / length[-1] + turning / turning[-1], angles
    )
    quarter = np.concatenate([eighth, np.pi / 2.0 - eighth[-2:0:-1]])
    x, y = _superellipse((quarter + np.pi / 2.0 * np.arange(4)[:, None]).ravel(), exponent).T
    return np.stack([x, np.zeros_like(x), -y], axis=1)


def _reach(radians: FloatArray, exponent: float) -> FloatArray:
    """The radius of a superellipse of half-width 1 in directions."""
    powers = np.abs(np.cos(radians)) ** exponent + np.abs(np.sin(radians)) ** exponent
    radii: FloatArray = powers ** (-1.0 / exponent)
    return radii


def _superellipse(radians: FloatArray, exponent: float) -> FloatArray:
    """Points of a superellipse in directions (n,), float64 (n, 2)."""
    rays = np.stack([np.cos(radians), np.sin(radians)], axis=1)
    points: FloatArray = _reach(radians, exponent)[:, None] * rays
    return points


@dataclass(frozen=True, eq=False)
class Wall:
    """A wall of constant thickness outside an inner outline, cut horizontally at the foot.

    inner: float64 (n, 2), radius and height, rising from the foot to the rim
    thickness: above 0
    floor: thickness of the floor
    """

    inner: FloatArray
    thickness: float
    floor: float

    @cached_property
    def tangents(self) -> FloatArray:
        """Unit directions of the inner outline at its points, float64 (n, 2)."""
        steps = np.diff(self.inner, axis=0)
        steps /= np.hypot(steps[:, 0], steps[:, 1])[:, None]
        turning = np.concatenate([steps[:1], steps[:-1] + steps[1:], steps[-1:]])
        unit: FloatArray = turning / np.hypot(turning[:, 0], turning[:, 1])[:, None]
        return unit

    @cached_property
    def _offset(self) -> tuple[FloatArray, npt.NDArray[np.int64]]:
        """The outer points at least a wall's thickness from the inner outline, float64 (m, 2), and their inner points'
        indices."""
        normals = np.stack([self.tangents[:, 1], -self.tangents[:, 0]], axis=1)
        points = self.inner + self.thickness * normals
        starts, steps = self.inner[:-1], np.diff(self.inner, axis=0)
        away = points[:, None] - starts
        share = np.clip((away * steps).sum(axis=2) / (steps * steps).sum(axis=1), 0.0, 1.0)
        away -= share[:, :, None] * steps
        distance = np.sqrt((away * away).sum(axis=2).min(axis=1))
        kept = np.flatnonzero((distance > 0.97 * self.thickness) & (points[:, 1] > self.inner[0, 1] + 1e-4))
        return points[kept], kept

    @cached_property
    def outer(self) -> FloatArray:
        """The outer outline from the level of the foot to the rim, float64 (m, 2)."""
        points, kept = self._offset
        foot = self.inner[0, 1]
        first = points[0]
        if kept[0] > 0:
            # A bulge directly at the foot is cut off at the level of the foot.
            ahead = self.inner[kept[0] - 1] + self.thickness * np.array(
                [self.tangents[kept[0] - 1, 1], -self.tangents[kept[0] - 1, 0]]
            )
            share = np.clip((foot - ahead[1]) / (first[1] - ahead[1]), 0.0, 0.95) if first[1] > ahead[1] else 0.95
            radius = ahead[0] + share * (first[0] - ahead[0])
        else:
            radius = first[0]
        return np.concatenate([[[radius, foot]], points])

    def split(self, shoulder: int) -> tuple[FloatArray, FloatArray]:
        """Split the vessel at the inner point `shoulder`.

        Returns the closed outline of the wall above, with a tongue in the wall below, float64 (a, 2); and the outline
        of the vessel below, from pole to pole, float64 (b, 2).
        """
        _, kept = self._offset
        index = int(np.searchsorted(kept, shoulder))
        upper, lower = self.outer[index + 1 :], self.outer[: index + 2]
        inside, outside = self.inner[shoulder], upper[0]
        down = self.tangents[shoulder] * 0.5 * self.thickness
        tongue = outside + np.array([[0.7], [0.3]]) * (inside - outside)
        collar = np.concatenate([self._rim(), self.inner[-1:shoulder:-1], [inside]])
        above = np.concatenate([upper, collar, tongue[:1], tongue - down, tongue[1:]])
        return above, np.concatenate([self._closed(lower), self._cavity(shoulder)])

    def whole(self) -> FloatArray:
        """The outline of the vessel up to its rim, from pole to pole, float64 (a, 2)."""
        return np.concatenate([self._closed(self.outer), self._rim(), self._cavity(len(self.inner) - 1)])

    def _rim(self) -> FloatArray:
        """Points that round off the rim, from the outside in, float64 (3, 2)."""
        outside, inside = self.outer[-1], self.inner[-1]
        middle, half = (outside + inside) / 2.0, (outside - inside) / 2.0
        along = self.tangents[-1] * self.thickness / 2.0
        angles = np.radians([[45.0], [90.0], [135.0]])
        rounded: FloatArray = middle + np.cos(angles) * half + np.sin(angles) * along
        return rounded

    def seat(self) -> FloatArray:
        """The highest point of the rim, where a lid is placed, float64 (2,)."""
        rim = np.concatenate([self.outer[-1:], self._rim(), self.inner[-1:]])
        highest: FloatArray = rim[rim[:, 1].argmax()]
        return highest

    def opening(self, depth: float) -> float:
        """The smallest inner radius within `depth` of the rim."""
        return float(self.inner[self.inner[:, 1] >= self.inner[-1, 1] - depth, 0].min())

    def _closed(self, outer: FloatArray) -> FloatArray:
        return np.concatenate([[[0.0, self.inner[0, 1]]], outer])

    def _cavity(self, top: int) -> FloatArray:
        """The outline down the inner side from its point `top` to the floor, and to the middle."""
        level = self.inner[0, 1] + self.floor
        inner = self.inner[: top + 1]
        above = inner[inner[:, 1] > level + 1e-4][::-1]
        radius = float(np.interp(level, inner[:, 1], inner[:, 0]))
        return np.concatenate([above, [[radius, level], [0.0, level]]])

    def radius(self, height: FloatArray) -> FloatArray:
        """Outer radius at heights; constant below the foot and above the rim."""
        rising = np.maximum.accumulate(self.outer[:, 1])
        radii: FloatArray = np.interp(height, rising, self.outer[:, 0])
        return radii
