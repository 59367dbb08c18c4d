"""The dimensions of a chair, shared by all its parts (geocode §3.1, "structural integrity")."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from stages.programs.curves import Profile, QuadMesh, loft_rings, square_circle
from stages.programs.schema import Values
from stages.shape.arrays import FloatArray

WOOD, SEAT, METAL = (151, 104, 66), (176, 128, 84), (92, 96, 102)
FABRIC, LEATHER = (64, 104, 122), (118, 66, 50)
"""Colours of frame, seat board, swivel base, upholstery and arm pads."""

SEAT_OUTLINE_POINTS = 40
"""A multiple of 8; the first is at a corner."""


@dataclass(frozen=True, eq=False)
class ChairDimensions:
    """The dimensions in metres: a chair of scale 1 is half a metre wide and deep, and 0.95 high.

    The middle of the seat is over the origin.

    x, z: distances of legs and posts from it, to each side, within the outline of the seat
    unit: thickness of a post
    """

    values: Values

    @cached_property
    def unit(self) -> float:
        """Grows with the chair, but much less."""
        size = float(self.values["scale x"] * self.values["scale y"] * self.values["scale z"])
        return float(0.04 * size**0.25)

    @cached_property
    def width(self) -> float:
        return 0.5 * float(self.values["scale x"])

    @cached_property
    def depth(self) -> float:
        return 0.5 * float(self.values["scale y"])

    @cached_property
    def height(self) -> float:
        return 0.95 * float(self.values["scale z"])

    @cached_property
    def seat_top(self) -> float:
        """Between a quarter and three fifths of the chair's height."""
        return self.height * (0.16 + 0.44 * float(self.values["seat_pos"]))

    @cached_property
    def seat_thickness(self) -> float:
        return 1.1 * self.unit

    @cached_property
    def seat_middle(self) -> float:
        """The height inside the seat of the ends of attached parts."""
        return self.seat_top - 0.55 * self.seat_thickness

    @cached_property
    def back_height(self) -> float:
        """From the seat to the top of the posts."""
        return self.height - self.seat_top

    @cached_property
    def outline(self) -> Profile:
        """The seat from above; its first point is the corner at +x, +z."""
        return square_circle(float(self.values["seat_shape"]), self.width, self.depth, SEAT_OUTLINE_POINTS)

    @cached_property
    def x(self) -> float:
        return float(self.outline.points[0, 0]) - 0.72 * self.unit

    @cached_property
    def z(self) -> float:
        return float(self.outline.points[0, 1]) - 0.72 * self.unit

    def rim(self, z: float) -> float:
        """Half the width of the seat at a depth between its corners."""
        quarter = SEAT_OUTLINE_POINTS // 4
        right = np.roll(self.outline.points, quarter, axis=0)[: quarter + 1]
        return float(np.interp(z, right[:, 1], right[:, 0]))

    @cached_property
    def _leaning(self) -> tuple[float, float]:
        """The lean of the back in shares of its height: by its bend half way up, and at its top."""
        middle, top = (float(self.values[f"back_frame_{place}_y_offset_pct"]) for place in ("mid", "top"))
        return 0.48 * middle, 0.35 * top

    def up(self, u: float) -> FloatArray:
        """The upward unit direction of the back at a relative height, float64 (3,)."""
        bend, recline = self._leaning
        slope = bend * (1.0 - 2.0 * u) + recline * 2.0 * u
        along: FloatArray = np.array([0.0, 1.0, -slope]) / np.hypot(1.0, slope)
        return along

    def back(self, x: npt.ArrayLike, u: npt.ArrayLike) -> FloatArray:
        """Points of the surface of the back, float64 (..., 3), at distances x from the middle and relative heights u.

        It is straight on the seat between the posts, and bows backwards with height.
        """
        x, u = np.broadcast_arrays(np.asarray(x, dtype=np.float64), np.asarray(u, dtype=np.float64))
        bend, recline = self._leaning
        bow = 0.5 * float(self.values["curvature"]) * min(self.x, 0.5 * self.depth)
        behind = self.back_height * (bend * u * (1.0 - u) + recline * u * u)
        behind += bow * np.maximum(1.0 - (x / self.x) ** 2, 0.0) * (1.0 - (1.0 - np.minimum(u, 1.0)) ** 2)
        return np.stack([x, self.seat_top + self.back_height * u, -self.z - behind], axis=-1)


def section(chair: ChairDimensions, thickness: float) -> Profile:
    """The section of legs, column and posts, `thickness` in units: a sharp square to a smaller circle."""
    round_ = float(chair.values["legs_bevel"])
    return square_circle(round_, (1.1 - 0.14 * round_) * thickness * chair.unit)


def post(centers: FloatArray, profile: Profile, scale: FloatArray) -> QuadMesh:
    """A post with horizontal sections, so that it is flat on the ground however it leans.

    centers: float64 (n, 3), from the lowest to the highest
    scale: of the sections, (n,), or (n, 2) for the profile's x and y
    """
    flat = np.zeros((len(profile), 3))
    flat[:, 0], flat[:, 2] = profile.points[:, 0], -profile.points[:, 1]
    factors = np.ones((len(scale), 3))
    factors[:, [0, 2]] = scale[:, None] if scale.ndim == 1 else scale
    return loft_rings(centers[:, None] + factors[:, None] * flat)
