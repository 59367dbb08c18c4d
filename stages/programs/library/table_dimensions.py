"""The dimensions of a table: sizes in metres, outline and edge of the top, upright lofts."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from stages.programs.curves import Profile, QuadMesh, loft_rings, rectangle
from stages.programs.schema import Values
from stages.shape.arrays import FloatArray

OAK, WALNUT, METAL = (201, 164, 118), (122, 85, 58), (74, 77, 82)

CORNER_SEGMENTS = 9
"""Of a top that is not square."""

CORNER_CUT = 1.0 - np.cos(np.pi / 4.0)
"""Along each axis, in the middle of a corner of radius 1."""


class TableDimensions:
    """The sizes of the table at `values`, in metres.

    half: half width and depth of the top, float64 (2,)
    height, under: heights of the upper and of the lower side of the top
    thickness: of the top
    sunk: height inside the top of the ends of legs
    stick: thickness of legs
    """

    def __init__(self, values: Values) -> None:
        self.values = values
        self.half = 0.3 * np.array([values["table_top_scale_x"], values["table_top_scale_y"]])
        self.height = 0.55 + 0.5 * values["table_top_height"]
        self.thickness = 0.018 + 0.052 * values["table_top_thickness"]
        self.under = self.height - self.thickness
        self.sunk = self.height - 0.6 * self.thickness
        self.stick = 0.02 + 0.038 * float(np.sqrt(4.0 * self.half.prod()))

    @cached_property
    def outline(self) -> FloatArray:
        """The top from above, float64 (k, 2): from a rectangle with growing round corners to an ellipse."""
        round_ = self.values["table_top_shape"]
        if round_ < 1e-6:
            return rectangle(2.0 * self.half[0], 2.0 * self.half[1]).points
        around = np.radians(np.arange(4)[:, None] * 90.0 + np.linspace(0.0, 90.0, CORNER_SEGMENTS + 1)).ravel()
        corner = np.repeat([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]], CORNER_SEGMENTS + 1, axis=0)
        unit = (1.0 - round_) * corner + round_ * np.stack([np.cos(around), np.sin(around)], axis=1)
        return Profile.of(unit * self.half).points

    @cached_property
    def edge(self) -> FloatArray:
        """The edge of the top from its upper side down, float64 (r, 2): distances inwards and downwards."""
        state, amount = self.values["table_top_profile_state"], 0.25 + 0.75 * self.values["table_top_profile_strength"]
        if state == 0:
            shares, most = [(0.0, 0.0), (0.0, 1.0)], 0.0
        elif state == 1:  # a bullnose
            turn = np.linspace(-np.pi / 2.0, np.pi / 2.0, 9)
            shares, most = [(1.0 - np.cos(angle), 0.5 + 0.5 * np.sin(angle)) for angle in turn.tolist()], 0.9
        elif state == 2:  # cut away below, so that it looks thin
            shares, most = [(0.0, 0.0), (0.0, 0.25), (1.0, 1.0)], 2.6
        else:  # an ogee above a lip
            swing = [(0.5 + 0.5 * np.cos(np.pi * t), 0.12 + 0.6 * t) for t in np.linspace(0.0, 1.0, 7).tolist()]
            shares, most = [(1.0, 0.0), *swing, (0.0, 1.0)], 1.3
        reach = amount * min(most * (self.thickness + 0.01), 0.22 * float(self.half.min()))
        edge: FloatArray = np.array(shares) * [reach, self.thickness]
        return edge

    @cached_property
    def bearing(self) -> FloatArray:
        """Half width and depth of the lower side of the top, float64 (2,)."""
        bearing: FloatArray = self.half - self.edge[-1, 0]
        return bearing

    @cached_property
    def corner(self) -> FloatArray:
        """The middle of the corner of the lower side at +x and +z, float64 (2,)."""
        corner: FloatArray = self.bearing * (1.0 - CORNER_CUT * self.values["table_top_shape"])
        return corner

    @cached_property
    def spread(self) -> FloatArray:
        """Half axes of the ellipse for a single foot, float64 (2,): rounder than the top."""
        spread: FloatArray = np.sqrt(self.bearing * self.bearing.min())
        return spread


def ring_mesh(outline: FloatArray, centers: FloatArray, scale: FloatArray) -> QuadMesh:
    """The mesh over horizontal rings, flat on the ground however it slants.

    outline: (k, 2) in the plane of x and z, convex
    centers: (r, 3), from the top down
    scale: of the outline, (r,) or (r, 2)
    """
    rings = np.repeat(centers[:, None], len(outline), axis=1)
    rings[..., [0, 2]] += outline * (scale[:, None, None] if scale.ndim == 1 else scale[:, None])
    return loft_rings(rings)
