"""The vase: a hollow body with wall, neck, foot, handles and lid (geocode §3.2)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stages.programs.curves import Part, bezier, ellipsoid
from stages.programs.library.vase_handles import handles
from stages.programs.library.vessel import VesselSection, Wall
from stages.programs.parameters import binary, continuous, discrete
from stages.programs.program import Program
from stages.programs.schema import Values
from stages.shape.arrays import FloatArray

CLAY, SAND, EARTH, IRON = (196, 134, 96), (214, 170, 128), (128, 78, 56), (98, 70, 58)
GLAZE, KNOB = (120, 146, 148), (72, 92, 104)

MIN_WALL_THICKNESS = 0.008
"""Of a vase without body thickness."""

NECK_HEIGHT_PER_THICKNESS = 1.5
"""Additional height of a neck for additional thickness of its wall."""

HANDLES = "handle_count > 0"
NECK = "has_neck"
CLOSED, FREE = "handle_count > 0 and hndl_type == 1", "handle_count > 0 and hndl_type == 2"


def build(values: Values) -> Sequence[Part]:
    """Build the parts of a vase on the plane y = 0 around the y axis; its first handle points to +x."""
    section = VesselSection(values["body_profile_blend"])
    thickness = values["body_thickness_val"] if values["has_body_thickness"] else MIN_WALL_THICKNESS
    lift = _base_height(values)
    body = _body(values, lift)
    neck = _neck(values, body, thickness) if values["has_neck"] else body[:0]
    wall = Wall(np.concatenate([body, neck]), thickness, max(thickness, 0.014))
    body_top = float(body[-1, 1])
    parts = []
    if values["has_neck"]:
        above, below = wall.split(len(body) - 1)
        parts.append(Part("body", section.around(below), CLAY))
        parts.append(Part("neck", section.around(above, ring=True), SAND))
    else:
        parts.append(Part("body", section.around(wall.whole()), CLAY))
    if values["has_base"]:
        parts.append(Part("base", section.around(_base(values, wall, lift)), EARTH))
    parts.extend(handles(values, wall, section, body_top, IRON))
    if values["has_lid"]:
        parts.extend(_lid(values, wall, section))
    return parts


def _body(values: Values, lift: float) -> FloatArray:
    """Inner outline of the body from its bottom to its mouth, float64 (n, 2)."""
    width, height = values["body_width"], values["body_height"]
    controls = [
        [0.5, 0.0],
        [0.25 + 1.35 * values["body_bottom_curve_width"], values["body_bottom_curve_height"]],
        [0.25 + 1.35 * values["body_top_curve_width"], 1.0 - values["body_top_curve_height"]],
        [0.3 + values["body_mouth_width"], 1.0],
    ]
    return bezier(np.array(controls) * [width, height] + [0.0, lift], 20).points[:, :2]


def _neck(values: Values, body: FloatArray, thickness: float) -> FloatArray:
    """Inner outline of the neck above the mouth of the body, float64 (n, 2).

    A thicker neck is higher, so that the outside of its waist fits between body and rim.
    """
    mouth, top = body[-1]
    height = 0.08 + NECK_HEIGHT_PER_THICKNESS * (thickness - MIN_WALL_THICKNESS) + 0.37 * values["neck_end_z"]
    end = 0.55 * mouth + (values["neck_end_x"] - 0.1) / 0.9 * (0.45 * mouth + 0.4 * values["body_width"])
    slope = (body[-1, 0] - body[-2, 0]) / (body[-1, 1] - body[-2, 1])
    narrow, wide = 0.55 * min(mouth, end), 1.15 * max(mouth, end)
    waist = narrow + (wide - narrow) * values["neck_end_bezier_handle_x"]
    # It is vertical at its waist or bulge, and continues the slope of the body at the mouth.
    level = 0.8 - 0.6 * values["neck_end_bezier_handle_z"]
    on = np.clip(0.33 * level * height * slope, -0.3 * mouth, 0.3 * mouth)
    rest = 1.0 - level
    shares = np.array(
        [
            [mouth, 0.0],
            [mouth + on, 0.33 * level],
            [waist, 0.55 * level],
            [waist, level],
            [waist, level + 0.45 * rest],
            [waist + 0.6 * (end - waist), level + 0.75 * rest],
            [end, 1.0],
        ]
    )
    return bezier(shares * [1.0, height] + [0.0, top], 7).points[1:, :2]


def _base_height(values: Values) -> float:
    return 0.05 + 0.25 * values["base_start_z"] if values["has_base"] else 0.0


def _base(values: Values, wall: Wall, height: float) -> FloatArray:
    """Outline of the foot, from pole to pole, float64 (n, 2); its top is inside the floor of the body."""
    body = float(wall.outer[0, 0])
    foot, middle, top = (
        body * share for share in (0.6 + 1.1 * values["base_start_x"], 0.3 + 0.95 * values["base_mid_x"], 0.92)
    )
    edge = 0.18 * height
    waist = edge + (0.2 + 0.6 * values["base_mid_z"]) * (height - edge)
    t = np.linspace(0.0, 1.0, 8)
    bend = t * t * (3.0 - 2.0 * t)
    lower = np.column_stack([foot + (middle - foot) * bend, edge + (waist - edge) * t])
    upper = np.column_stack([middle + (top - middle) * bend, waist + (height - waist) * t])[1:]
    start, tongue = (
        [[0.0, 0.0], [foot, 0.0]],
        [[0.85 * body, height + 0.5 * wall.floor], [0.0, height + 0.5 * wall.floor]],
    )
    return np.concatenate([start, lower, upper, tongue])


def _lid(values: Values, wall: Wall, section: VesselSection) -> list[Part]:
    """The lid on the rim, and its knob; a small lid has a smaller knob."""
    radius, level = wall.seat()
    radius, level = radius + 0.35 * wall.thickness, level - 0.1 * wall.thickness
    depth = 0.02
    plug = 0.9 * wall.opening(1.5 * depth)
    dome = 0.04 + 0.2 * radius
    edge = min(0.012, 0.2 * radius)
    angles = np.linspace(0.0, np.pi / 2.0, 11)
    vault = np.column_stack([radius * np.cos(angles), level + edge + dome * np.sin(angles)])
    vault[-1, 0] = 0.0
    under = [[0.0, level - depth], [plug, level - depth], [plug, level], [radius, level]]
    lid = Part("lid", section.around(np.concatenate([under, vault])), GLAZE)
    if not values["has_lid_handle"]:
        return [lid]
    knob = values["lid_handle_radius"] * min(1.0, radius / 0.14)
    middle = level + edge + dome + 0.7 * knob
    return [lid, Part("lid_handle", ellipsoid([knob] * 3, (0.0, middle, 0.0), 24), KNOB)]


PROGRAM = Program(
    name="vase",
    description="A hollow vase, round or square, with a wall, and a neck, a foot, handles and a lid where it has them.",
    parameters=(
        continuous("body_height", 0.5, 1.5, 15, 1.2143, "body", "Height of the body."),
        continuous("body_width", 0.1, 0.45, 10, 0.2944, "body", "Width of the body; all radii follow it."),
        continuous("body_bottom_curve_width", 0.0, 1.0, 11, 0.0, "body", "How far the body bulges near the bottom."),
        continuous("body_bottom_curve_height", 0.1, 0.9, 9, 0.6, "body", "How high up the lower bulge reaches."),
        continuous("body_mouth_width", 0.0, 0.7, 8, 0.6, "body", "Width of the mouth, as a share of the body's."),
        continuous("body_top_curve_width", 0.0, 0.9, 10, 0.2, "body", "How far the body bulges near the mouth."),
        continuous("body_top_curve_height", 0.1, 0.9, 9, 0.9, "body", "How far down the upper bulge reaches."),
        continuous("body_profile_blend", 0.0, 1.0, 11, 0.8, "body", "Seen from above: from a soft square to a circle."),
        binary("has_body_thickness", False, "body", "Whether the wall is thick; else it is as thin as a shell."),
        continuous(
            "body_thickness_val",
            0.01,
            0.07,
            7,
            0.06,
            "body",
            "Thickness of a thick wall, outside the opening.",
            visible_if="has_body_thickness and not has_lid",
        ),
        discrete("handle_count", 0, 6, 5, "handles", "Number of handles, evenly around the body."),
        discrete("hndl_type", 1, 2, 2, "handles", "1: both ends on the body; 2: the upper end free.", HANDLES),
        continuous("hndl_profile_width", 0.0, 1.0, 6, 1.0, "handles", "Width of a handle.", HANDLES),
        continuous("hndl_profile_height", 0.0, 1.0, 6, 0.2, "handles", "Thickness of a handle.", HANDLES),
        continuous(
            "hndl_profile_blend", 0, 1, 6, 0.8, "handles", "Profile: from a square strap to a round cord.", HANDLES
        ),
        continuous("hndl_base_z", 0.1, 0.6, 6, 0.47, "handles", "How high up the body a handle starts.", HANDLES),
        continuous(
            "hndl_base_bezier_handle_angle",
            0,
            1,
            11,
            0.4,
            "handles",
            "Where a handle heads at its start: from downwards to upwards.",
            HANDLES,
        ),
        continuous(
            "hndl_base_bezier_handle_length", 0, 1, 6, 0.2, "handles", "How far a handle goes that way.", HANDLES
        ),
        continuous(
            "hndl_radius_along_path",
            0,
            1,
            11,
            0.0,
            "handles",
            "Girth half-way along a handle: from slim to swollen.",
            HANDLES,
        ),
        continuous(
            "hndl1_top_z", 0.2, 0.8, 7, 0.5, "handles", "How high above its start a handle of type 1 ends.", CLOSED
        ),
        continuous(
            "hndl1_end_bezier_handle_angle",
            0,
            1,
            11,
            0.2,
            "handles",
            "Where a handle of type 1 comes from at its end: from below to above.",
            CLOSED,
        ),
        continuous(
            "hndl1_end_bezier_handle_length",
            0,
            1,
            6,
            0.6,
            "handles",
            "From how far a handle of type 1 comes that way.",
            CLOSED,
        ),
        continuous("hndl2_end_x", 0.0, 1.0, 11, 0.0, "handles", "How far from the wall the free end is.", FREE),
        continuous("hndl2_end_z", 0.0, 1.0, 11, 0.41, "handles", "How high above its start the free end is.", FREE),
        continuous(
            "hndl2_end_bezier_handle_x", 0.0, 1.0, 11, 0.0, "handles", "How far out it comes to the free end.", FREE
        ),
        continuous(
            "hndl2_end_bezier_handle_z",
            0.1,
            1.0,
            10,
            0.2,
            "handles",
            "From how high it comes to the free end: from below to above it.",
            FREE,
        ),
        binary("has_neck", True, "neck", "Whether the body has a neck."),
        continuous("neck_end_x", 0.1, 1.0, 10, 0.8, "neck", "Width of the opening of the neck.", NECK),
        continuous("neck_end_z", 0.0, 1.0, 11, 0.8, "neck", "Height of the neck.", NECK),
        continuous(
            "neck_end_bezier_handle_x",
            0,
            1,
            11,
            0.8,
            "neck",
            "Width of the neck where it is narrowest or widest: from a waist to a bulge.",
            NECK,
        ),
        continuous(
            "neck_end_bezier_handle_z",
            0,
            1,
            11,
            0.0,
            "neck",
            "How far below the lip that is: from a spread lip to an even one.",
            NECK,
        ),
        binary("has_base", True, "base", "Whether the body has a foot."),
        continuous("base_start_x", 0.0, 1.0, 11, 0.7, "base", "Width of the foot on the ground.", "has_base"),
        continuous("base_start_z", 0.0, 1.0, 6, 0.6, "base", "Height of the foot.", "has_base"),
        continuous("base_mid_x", 0.0, 1.0, 11, 0.2, "base", "Width of the foot at its waist.", "has_base"),
        continuous("base_mid_z", 0.0, 1.0, 6, 0.8, "base", "How high up the foot its waist is.", "has_base"),
        binary("has_lid", False, "lid", "Whether a lid covers the opening."),
        binary("has_lid_handle", True, "lid", "Whether the lid has a knob.", "has_lid"),
        continuous(
            "lid_handle_radius", 0.02, 0.07, 6, 0.02, "lid", "Radius of the knob.", "has_lid and has_lid_handle"
        ),
    ),
    labels=("body", "neck", "base", "handle", "lid", "lid_handle"),
    build=build,
    non_intersecting=(("handle", "handle"), ("handle", "lid"), ("handle", "lid_handle")),
)
