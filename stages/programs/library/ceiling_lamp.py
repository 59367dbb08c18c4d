"""The ceiling lamp: a plate under the ceiling, and arms around it with a bulb each (geocode §4.1)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stages.programs.curves import (
    Curve,
    Part,
    QuadMesh,
    Style,
    loft_rings,
    polyline,
    revolve,
    rotation,
    square_circle,
    sweep,
    translation,
)
from stages.programs.library.rails import cubic, eased
from stages.programs.parameters import continuous, discrete
from stages.programs.program import Program
from stages.programs.schema import Values
from stages.shape.arrays import FloatArray

PLATE, BRASS, LIGHT = (150, 158, 168), (186, 148, 84), (250, 238, 196)

PLATE_OUTLINE_POINTS, BULB_OUTLINE_POINTS = 48, 24
ARM_SEGMENTS, ARM_OUTLINE_POINTS = 20, 12


def build(values: Values) -> Sequence[Part]:
    """Build the parts of a lamp that hangs from the plane y = 0 around the y axis; its first arm points to +x."""
    half = 0.05 + np.array([values["base_x"], values["base_y"]]) / 2.0
    parts = [Part("base", _base(values, half), PLATE)]
    wide, thick = 0.6 * values["light_frame_thickness_x"], 0.6 * values["light_frame_thickness_y"]
    end = 0.5 + 0.9 * values["light_frame_style"]
    # A bulb protrudes from the end of its arm, however thick that is.
    bulb = values["lightbulb_ radius"] + 0.3 * end * min(wide, thick)
    count = values["light_frame_count"]
    # Arms start within the flat underside of the plate, and end where the bulbs have room.
    seat = values["light_frame_radius"] * (0.8 * half - _inset(values, half) - 0.5 * max(wide, thick)).clip(min=0.004)
    needed = (1.3 * bulb + 0.015) / np.sin(np.pi / count) if count > 1 else 0.0
    reach = max(float(needed) - float(seat.min()), 0.0) + values["light_frame_end_point_y"]
    taper = Style.knots([(0.0, 1.0), (0.7, 0.7 + 0.15 * end), (1.0, end)], smooth=True, count=8)
    # A round arm is turned on a lathe: it swells along its length.
    swell = values["light_frame_roundness"] * (0.3 * max(wide, thick) + 0.036)
    rail = _rail(values, reach, 0.6 * (max(wide, thick) * taper.scale.max() + swell))
    profile = square_circle(0.1 + 0.9 * values["light_frame_roundness"], thick, wide, count=ARM_OUTLINE_POINTS)
    turned = np.sin(np.pi * rail.positions)[:, None] ** 2 * swell / np.array([thick, wide])
    style = Style(rail.positions, taper.at(rail.positions)[0] + turned, np.zeros(len(rail.positions)))
    swept = sweep(rail, profile, style, up=(0.0, 0.0, 1.0))
    # An arm ends at one level within the plate, whatever its direction.
    level = swept.vertices.copy()
    level[:ARM_OUTLINE_POINTS, 1] = level[-2, 1] = -0.5 * _thickness(values)
    arm = QuadMesh(level, swept.quads)
    light = _bulb(bulb, 0.4 * end * min(wide, thick)).transformed(rail.frames(1.0, up=(0.0, 0.0, 1.0)))
    shape = 0.1 + 0.9 * values["base_roundness"]
    for angle in (360.0 / count * np.arange(count)).tolist():
        across, along = np.cos(np.radians(angle)), np.sin(np.radians(angle))
        share = (abs(across) ** (2.0 / shape) + abs(along) ** (2.0 / shape)) ** (-shape / 2.0)
        pose = translation(seat[0] * share * across, 0.0, -seat[1] * share * along) @ rotation("y", angle)
        parts.append(Part("light_frame", arm.transformed(pose), BRASS))
        parts.append(Part("lightbulb", light.transformed(pose), LIGHT))
    return parts


def _bulb(radius: float, neck: float) -> QuadMesh:
    """A bulb along z, from a neck within the end of its arm at 0 to a ball farther out."""
    neck = min(neck, 0.6 * radius)
    turn = np.linspace(0.3 * np.pi, np.pi, 10)
    ball = np.stack([np.sin(turn), 1.35 - np.cos(turn)], axis=1) * radius
    arriving = ball[0] - 0.5 * radius * np.array([np.cos(turn[0]), np.sin(turn[0])])
    throat = cubic([[neck, -0.3 * radius], [neck, 0.4 * radius], arriving, ball[0]], 5)
    outline = polyline(np.concatenate([throat, ball[1:]]))
    return revolve(outline, count=BULB_OUTLINE_POINTS).transformed(rotation("x", 90.0))


def _thickness(values: Values) -> float:
    """Thickness of the plate, enough to show its edge."""
    return 0.015 + float(values["base_thickness"])


def _inset(values: Values, half: FloatArray) -> float:
    """The difference between the plate's outline and that of its underside."""
    strength = 0.35 + 0.65 * values["base_profile_strength"]
    return float(strength * min(0.6 * half.min(), 0.05 + 0.8 * _thickness(values)))


def _base(values: Values, half: FloatArray) -> QuadMesh:
    """The plate: its edge is slanted, rounded, hollowed or stepped."""
    inset, thickness = _inset(values, half), _thickness(values)
    turn = np.linspace(0.0, np.pi / 2.0, 7)
    # Pairs of shares inwards and downwards, from the ceiling to the underside.
    edges = (
        np.array([[0.0, 0.0], [0.0, 0.3], [1.0, 1.0]]),
        np.column_stack([1.0 - np.cos(turn), np.sin(turn)]),
        np.column_stack([np.sin(turn), 1.0 - np.cos(turn)]),
        np.array([[0.0, 0.0], [0.0, 0.5], [0.85, 0.55], [1.0, 1.0]]),
    )
    edge = edges[values["base_profile_type"]][::-1]
    plan = square_circle(0.1 + 0.9 * values["base_roundness"], 2.0, count=PLATE_OUTLINE_POINTS).points * [1.0, -1.0]
    rings = np.empty((len(edge), PLATE_OUTLINE_POINTS, 3))
    rings[:, :, [0, 2]] = plan * (half - inset * edge[:, :1])[:, None]
    rings[..., 1] = -thickness * edge[:, 1:]
    return loft_rings(rings)


def _rail(values: Values, reach: float, girth: float) -> Curve:
    """The curve of an arm from within the plate at x = 0 to its end at x = `reach`, bowed sideways.

    girth: radius of its profile
    """
    under = -_thickness(values)
    position = 0.25 + 0.5 * values["light_frame_mid_point_pos"]
    out = position * reach + 0.04 + 0.24 * values["light_frame_mid_point_offset_y"]
    down = 0.08 + 0.2 * out
    end = 0.08 + values["light_frame_end_point_z"]
    middle = down + position * (end - 0.08) + 0.3 * values["light_frame_mid_point_offset_z"]
    curve = cubic([[0.0, 0.0], [0.0, -down], [out, -middle], [reach, -end]], ARM_SEGMENTS)
    length = float(np.hypot(*np.diff(curve, axis=0).T).sum())
    side = 0.3 * values["light_frame_turning_effect"] * length * np.sin(np.linspace(0.0, np.pi, ARM_SEGMENTS + 1)) ** 2
    below = np.column_stack([curve[:, 0], curve[:, 1] + under, side])
    points = np.concatenate([[[0.0, 0.5 * under, 0.0]], below])
    return Curve.through(eased(points, np.full(len(points), girth)))


PROGRAM = Program(
    name="ceiling_lamp",
    description="A ceiling lamp: a plate from which arms reach out and down, each with a bulb at its end.",
    parameters=(
        continuous("base_roundness", 0.0, 1.0, 6, 0.54, "base", "Plate seen from below: from a rectangle to an oval."),
        continuous("base_thickness", 0.01, 0.17, 5, 0.07, "base", "Thickness of the plate."),
        discrete("base_profile_type", 0, 3, 1, "base", "Edge of the plate: slanted, rounded, hollowed, stepped."),
        continuous("base_profile_strength", 0.0, 1.0, 6, 0.68, "base", "How far in the edge runs."),
        continuous("base_x", 0.03, 1.0, 8, 0.55, "base", "Width of the plate."),
        continuous("base_y", 0.03, 1.0, 8, 0.6, "base", "Depth of the plate, towards the front."),
        discrete("light_frame_count", 1, 8, 8, "arms", "Number of arms, each with a bulb."),
        continuous("light_frame_radius", 0.0, 1.0, 8, 0.79, "arms", "How far from the middle of the plate arms start."),
        continuous("light_frame_thickness_x", 0.02, 0.12, 5, 0.04, "arms", "Thickness of an arm across its plane."),
        continuous("light_frame_thickness_y", 0.02, 0.12, 5, 0.02, "arms", "Thickness of an arm within its plane."),
        continuous(
            "light_frame_roundness", 0.0, 1.0, 6, 0.64, "arms", "Profile of an arm: from square to round and turned."
        ),
        continuous("light_frame_style", 0.0, 1.0, 6, 0.5, "arms", "Girth at the end of an arm: from slim to flared."),
        continuous("lightbulb_ radius", 0.02, 0.1, 6, 0.08, "bulbs", "Radius of a bulb."),
        continuous("light_frame_mid_point_pos", 0.0, 1.0, 6, 0.516, "arms", "How far along an arm it bends."),
        continuous("light_frame_mid_point_offset_y", 0.0, 1.0, 6, 0.146, "arms", "How far an arm bends outwards."),
        continuous("light_frame_mid_point_offset_z", 0.0, 1.0, 6, 0.934, "arms", "How far an arm sags."),
        continuous("light_frame_turning_effect", 0.0, 1.0, 6, 0.5, "arms", "How far arms bow sideways, all one way."),
        continuous("light_frame_end_point_y", 0.0, 0.5, 6, 0.146, "arms", "How far out an arm ends."),
        continuous("light_frame_end_point_z", 0.12, 0.5, 5, 0.238, "arms", "How far down an arm ends."),
    ),
    labels=("base", "light_frame", "lightbulb"),
    build=build,
    non_intersecting=(("lightbulb", "lightbulb"), ("base", "lightbulb")),
    view_elevation=-25.0,
)
