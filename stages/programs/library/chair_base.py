"""The base of a chair: four legs, a pedestal, or a swivel base with a star of legs."""

from __future__ import annotations

import numpy as np

from stages.programs.curves import (
    Part,
    Profile,
    QuadMesh,
    Style,
    bezier,
    circle,
    cylinder,
    polyline,
    radial,
    square_circle,
    sweep,
    symmetric,
    translation,
)
from stages.programs.library.chair_dimensions import METAL, WOOD, ChairDimensions, post, section
from stages.programs.library.rails import cubic, eased
from stages.shape.arrays import FloatArray

LEG_RINGS = 9


def base_parts(chair: ChairDimensions) -> list[Part]:
    """The parts that carry the seat; their upper ends are inside it."""
    if not chair.values["is_monoleg"]:
        return _four_legs(chair)
    return _star(chair) if chair.values["is_monoleg_tent"] else [_pedestal(chair)]


def _four_legs(chair: ChairDimensions) -> list[Part]:
    """Straight legs in front, bent ones behind."""
    top = chair.seat_middle
    share = np.linspace(1.0, 0.0, LEG_RINGS)
    middle = 0.22 * top * float(chair.values["back_leg_mid_y_offset_pct"])
    foot = 0.35 * top * float(chair.values["back_leg_bottom_y_offset_pct"])
    centers = np.stack([np.full(LEG_RINGS, chair.x), top * (1.0 - share), np.full(LEG_RINGS, chair.z)], axis=1)
    behind = centers * [1.0, 1.0, -1.0]
    behind[:, 2] -= 3.0 * share * (1.0 - share) * middle + share**2 * foot
    profile = section(chair, 1.2)
    width = _width(chair, share)
    return symmetric([Part("leg", post(leg, profile, width), WOOD) for leg in (centers, behind)], "x")


def _width(chair: ChairDimensions, share: FloatArray) -> FloatArray:
    """Relative width of a leg at shares of its length, from the top."""
    foot = 0.38 + 0.74 * float(chair.values["legs_shape_1"])
    waist = (0.36 + 0.74 * float(chair.values["legs_shape_2"])) * (1.0 + foot) / 2.0
    width: FloatArray = (1.0 - share) * (1.0 - 2.0 * share) + 4.0 * share * (1.0 - share) * waist
    width += share * (2.0 * share - 1.0) * foot
    return width


def _handles(chair: ChairDimensions) -> FloatArray:
    """The handles of the curve of a single foot, float64 (2, 2): relative reach, and share of the height."""
    return np.array(
        [
            [
                0.12 + 0.88 * float(chair.values[f"monoleg_bezier_{end}_handle_x_offset"]),
                float(chair.values[f"monoleg_bezier_{end}_handle_z_pct"]),
            ]
            for end in ("start", "end")
        ]
    )


def _pedestal(chair: ChairDimensions) -> Part:
    """A turned foot with the Bezier curve as outline; its section is square to round, with the proportions of the
    seat."""
    lip = 0.5 * chair.unit
    top = 0.12 + 0.58 * float(chair.values["monoleg_bezier_start_x_offset"])
    ground = 0.4 + 0.6 * float(chair.values["monoleg_bezier_end_x_offset"])
    outline = bezier([[top, 0.0], *_handles(chair), [ground, 1.0]], count=14).points[::-1]
    heights = chair.seat_middle + (lip - chair.seat_middle) * outline[:, 1]
    narrow = min(chair.width, chair.depth)
    profile = square_circle(
        float(chair.values["legs_bevel"]),
        0.94 * (narrow * chair.width) ** 0.5,
        0.94 * (narrow * chair.depth) ** 0.5,
        count=24,
    )
    # A vertical lip on the ground, or a flat foot would have a sharp edge.
    radii = np.concatenate([outline[:1, 0], outline[:, 0]])
    return Part("pedestal", _upright(profile, np.concatenate([[0.0], heights]), radii), WOOD)


def _star(chair: ChairDimensions) -> list[Part]:
    """A column on a hub from which curved legs reach out to glides on the ground."""
    unit, values = chair.unit, chair.values
    reach = 0.5 * (chair.width * chair.depth) ** 0.5
    level = chair.seat_middle * float(values["monoleg_tent_pct"])
    hub = 0.6 * unit + 0.45 * reach * float(values["monoleg_bezier_start_x_offset"])
    end, foot = reach * (0.55 + 0.55 * float(values["monoleg_bezier_end_x_offset"])), 0.6 * unit
    # The upper handle stays above, the lower one below, or thick legs would intersect themselves.
    handles = _handles(chair) * [reach, 0.75] + [[0.0, 0.0], [0.0, 0.25]]
    controls = [[0.0, level + (foot - level) * down, out] for out, down in [(hub, 0.0), *handles.tolist(), (end, 1.0)]]
    profile = section(chair, 0.92)
    girth = np.hypot(*profile.points[0]) * _width(chair, np.linspace(0.0, 1.0, 13))
    rail = polyline(eased(cubic(controls, 12), girth))
    width = _width(chair, rail.positions)
    style = Style(rail.positions, np.stack([width, width], axis=1), np.zeros(len(width)))
    leg = Part("leg", sweep(rail, profile, style, up=(1.0, 0.0, 0.0), caps=("flat", "round")), METAL)
    glide = Part("glide", cylinder(0.5 * unit, 0.75 * unit).transformed(translation(0.0, 0.0, end)), METAL)
    column = section(chair, 1.3)
    heights, plate = np.array([level - 0.45 * unit, level + 0.45 * unit]), hub + 0.5 * unit
    return [
        Part("column", _upright(column, np.array([level, chair.seat_middle]), np.ones(2)), METAL),
        Part("hub", _upright(circle(plate, 24), heights, np.array([1.0, 1.0 - 0.2 * unit / plate])), METAL),
        *radial([leg, glide], int(values["monoleg_tent_count"])),
    ]


def _upright(profile: Profile, heights: FloatArray, scale: FloatArray) -> QuadMesh:
    """A post over the origin."""
    return post(heights[:, None] * [0.0, 1.0, 0.0], profile, scale)
