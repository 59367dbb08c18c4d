"""Four legs under a table, and the rails between them."""

from __future__ import annotations

import numpy as np

from stages.programs.curves import Part, Profile, QuadMesh, loft_rings, rounded_rectangle, square_circle, symmetric
from stages.programs.library.table_dimensions import WALNUT, TableDimensions, ring_mesh
from stages.shape.arrays import FloatArray

LEG_RINGS = 9
RAIL_SEGMENTS = 12


def leg_width(table: TableDimensions, share: FloatArray) -> FloatArray:
    """Relative width of a leg at shares (n,) of its length, from the top."""
    foot = 0.4 + 0.7 * table.values["legs_shape_1"]
    waist = (0.38 + 0.74 * table.values["legs_shape_2"]) * (1.0 + foot) / 2.0
    width: FloatArray = (1.0 - share) * (1.0 - 2.0 * share) + 4.0 * share * (1.0 - share) * waist
    width += share * (2.0 * share - 1.0) * foot
    return width


def leg_parts(table: TableDimensions) -> list[Part]:
    """The four legs, and the rails along x and along z."""
    frame = _Frame(table)
    share = np.linspace(0.0, 1.0, LEG_RINGS)
    heights = table.under * (1.0 - share)
    centers = np.column_stack([frame.at(heights), heights])[:, [0, 2, 1]]
    tip = centers[:1] * [1.0, 0.0, 1.0] + [0.0, table.sunk, 0.0]
    width = leg_width(table, share)
    mesh = ring_mesh(frame.section.points, np.concatenate([tip, centers]), np.concatenate([width[:1], width]))
    parts = symmetric(symmetric([Part("leg", mesh, WALNUT)], "x"), "z")
    if table.values["is_std_legs_support_x"]:
        parts += symmetric([_rail(table, frame, "x", 0)], "z")
    if table.values["is_std_legs_support_y"]:
        parts += symmetric([_rail(table, frame, "y", 1)], "x")
    return parts


class _Frame:
    """The course of the leg at +x and +z, and its section."""

    def __init__(self, table: TableDimensions) -> None:
        values = table.values
        angle = 90.0 * values["std_legs_rotation"]
        # A sharp square to a smaller ellipse.
        size = (1.08 - 0.12 * values["legs_bevel"]) * table.stick
        self.section = square_circle(values["legs_bevel"], 0.94 * size, 1.14 * size).rotated(-angle)
        self.table = table
        sine, cosine = np.sin(np.radians(angle)), np.cos(np.radians(angle))
        self.direction = np.array([sine, cosine])
        extent = self.section.size / 2.0
        offset = np.array([values["std_legs_top_offset_x"], values["std_legs_top_offset_y"]])
        self.top = (table.corner - extent) * (1.0 - 0.5 * offset)
        # Limits of the leg: inwards the middle of the table, outwards the edge of the top and a little more.
        safe = np.maximum(self.direction, 1e-9)
        room = float(((self.top - 1.2 * extent) / safe).min())
        beyond = float(((table.half - extent - self.top) / safe).min()) + 0.12 * table.under
        inmost, outmost = min(0.45 * room, 0.4 * table.under), min(beyond, 0.4 * table.under)
        self.foot = (inmost + outmost) * values["std_legs_bottom_offset_y"] - inmost
        self.waist = min(0.28 * table.under, 0.65 * room + 0.5 * self.foot) * values["std_legs_mid_offset_y"]

    def at(self, heights: FloatArray) -> FloatArray:
        """The leg's middle at `heights`, any shape (...), as x and z, (..., 2)."""
        down = 1.0 - heights / self.table.under
        out = self.foot * down - 4.0 * self.waist * down * (1.0 - down)
        middle: FloatArray = self.top + out[..., None] * self.direction
        return middle


def _rail(table: TableDimensions, frame: _Frame, name: str, axis: int) -> Part:
    """The rail along x (axis 0) at +z, or along z (axis 1) at +x.

    Its ends are in the middle of the legs at every height, so it leans with them. It may arch, and at its highest it
    touches the top. Its ends are as thick as the legs allow, its middle as its parameter says.
    """
    values, prefix = table.values, f"std_legs_support_{name}"
    tall = (0.05 + 0.12 * values[f"{prefix}_profile_height"]) * table.under
    lowest, highest = 0.1 * table.under + tall / 2.0, table.under + 0.3 * table.thickness - tall / 2.0
    level = lowest + (highest - lowest) * values[f"{prefix}_height"]
    span = float(frame.at(np.array(level))[axis])
    arch = min(0.75 * (level - tall / 2.0 - 0.03 * table.under), 0.25 * table.under, 0.5 * span)
    arch *= values[f"{prefix}_curvature"]
    thinnest = float(leg_width(table, np.linspace(0.0, 1.0, LEG_RINGS)).min())
    wide = (0.25 + 1.1 * values[f"{prefix}_profile_width"]) * table.stick
    end = min(wide, 0.7 * thinnest * table.stick)
    profile = rounded_rectangle(end, tall, 0.15 * min(end, tall), steps=1)
    return Part("support", _between_legs(frame, profile, wide / end, axis, level, arch), WALNUT)


def _between_legs(frame: _Frame, profile: Profile, swell: float, axis: int, level: float, arch: float) -> QuadMesh:
    """The rail at `level`, its ends lower by `arch`, its middle thicker by the factor `swell`."""
    along = np.linspace(-1.0, 1.0, RAIL_SEGMENTS + 1)
    across, rise = profile.points.T
    ends = frame.at(level - arch + rise)
    rings = np.empty((len(along), len(profile), 3))
    rings[..., 1] = rise + (level - arch * along * along)[:, None]
    rings[..., 0 if axis == 0 else 2] = along[:, None] * ends[:, axis]
    thick = 1.0 + (swell - 1.0) * (1.0 - along**4)
    rings[..., 2 if axis == 0 else 0] = ends[:, 1 - axis] + thick[:, None] * across
    # Rings along x and along z have opposite orientations.
    return loft_rings(rings[:, ::-1] if axis == 0 else rings)
