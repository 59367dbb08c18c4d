"""The program of tables (geocode §3.2): a top on four legs with rails, on a turned pedestal, or on a tent of legs."""

from __future__ import annotations

import numpy as np

from stages.programs.conditions import Condition
from stages.programs.curves import Part, Style, bezier, circle, cylinder, square_circle, sweep, translation
from stages.programs.library.table_dimensions import METAL, OAK, WALNUT, TableDimensions, ring_mesh
from stages.programs.library.table_legs import leg_parts, leg_width
from stages.programs.parameters import binary, continuous, discrete
from stages.programs.program import Constraint, Program
from stages.programs.schema import Values
from stages.shape.arrays import FloatArray

TENT_LEG_SEGMENTS = 10


def build(values: Values) -> list[Part]:
    """Build the parts of the table at `values`."""
    table = TableDimensions(values)
    centers = (table.height - table.edge[:, 1:]) * [0.0, 1.0, 0.0]
    top = Part("top", ring_mesh(table.outline, centers, 1.0 - table.edge[:, :1] / table.half), OAK)
    return [top, *(pedestal_parts(table) if values["is_monoleg"] else leg_parts(table))]


LEGS = "(is_monoleg and is_monoleg_tent) or (not is_monoleg)"
FOUR_LEGS = "not is_monoleg"
RAILS_X = "(not is_monoleg) and is_std_legs_support_x"
RAILS_Y = "(not is_monoleg) and is_std_legs_support_y"
TENT = "is_monoleg and is_monoleg_tent"
PEDESTAL = "is_monoleg and (not is_monoleg_tent or monoleg_tent_pct < 0.4)"

PARAMETERS = (
    continuous("table_top_scale_x", 0.6, 2.6, 12, 2.6, "top", "Width of the top; 1 is 0.6 metres."),
    continuous("table_top_scale_y", 0.6, 2.6, 12, 2.6, "top", "Depth of the top; 1 is 0.6 metres."),
    continuous("table_top_height", 0, 1, 8, 0, "top", "Height of the table, from a low one to a counter."),
    continuous("table_top_shape", 0, 1, 11, 1, "top", "The top from above, from square to round."),
    continuous("table_top_thickness", 0, 1, 6, 0, "top", "Thickness of the top."),
    discrete("table_top_profile_state", 0, 3, 2, "top", "Edge: straight, a bullnose, cut away below, or an ogee."),
    continuous(
        "table_top_profile_strength", 0, 1, 6, 0, "top", "How deep the edge is cut.", "table_top_profile_state > 0"
    ),
    continuous("legs_shape_1", 0, 1, 3, 1, "leg_shape", "Thickness of the legs at the ground.", LEGS),
    continuous("legs_shape_2", 0, 1, 3, 1, "leg_shape", "Thickness of the legs halfway down.", LEGS),
    continuous("legs_bevel", 0, 1, 3, 0, "leg_shape", "Section of the legs, from square to round.", LEGS),
    continuous("std_legs_bottom_offset_y", 0, 1, 6, 1, "legs", "How far out the feet stand.", FOUR_LEGS),
    continuous("std_legs_mid_offset_y", 0, 1, 6, 0, "legs", "How far the legs bend inwards halfway down.", FOUR_LEGS),
    continuous("std_legs_top_offset_x", 0, 1, 6, 0.27, "legs", "How far from the short sides legs begin.", FOUR_LEGS),
    continuous("std_legs_top_offset_y", 0, 1, 6, 0, "legs", "How far from the long sides legs begin.", FOUR_LEGS),
    continuous(
        "std_legs_rotation", 0, 1, 6, 0, "legs", "Turns legs from splaying front and back to sideways.", FOUR_LEGS
    ),
    binary("is_std_legs_support_x", True, "support_x", "Whether rails join left and right legs.", FOUR_LEGS),
    continuous("std_legs_support_x_height", 0, 1, 6, 0.72, "support_x", "Height of these rails.", RAILS_X),
    continuous("std_legs_support_x_curvature", 0, 1, 6, 0, "support_x", "How high they arch.", RAILS_X),
    continuous("std_legs_support_x_profile_width", 0, 1, 5, 1, "support_x", "How thick they are.", RAILS_X),
    continuous("std_legs_support_x_profile_height", 0, 1, 5, 0.27, "support_x", "How tall they are.", RAILS_X),
    binary("is_std_legs_support_y", True, "support_y", "Whether rails join front and back legs.", FOUR_LEGS),
    continuous("std_legs_support_y_height", 0, 1, 6, 0.36, "support_y", "Height of these rails.", RAILS_Y),
    continuous("std_legs_support_y_curvature", 0, 1, 6, 0, "support_y", "How high they arch.", RAILS_Y),
    continuous("std_legs_support_y_profile_width", 0, 1, 5, 1, "support_y", "How thick they are.", RAILS_Y),
    continuous("std_legs_support_y_profile_height", 0, 1, 5, 1, "support_y", "How tall they are.", RAILS_Y),
    binary("is_monoleg", False, "foot", "Whether the table stands on one foot in its middle."),
    binary("is_monoleg_tent", True, "foot", "Whether that foot is a column on a tent of legs.", "is_monoleg"),
    continuous("monoleg_tent_pct", 0.2, 0.8, 7, 0.665, "foot", "Height of the tent, as a share of the foot's.", TENT),
    continuous("monoleg_tent_base_radius", 0, 1, 11, 0, "foot", "How far the legs of the tent reach.", TENT),
    discrete("monoleg_tent_count", 3, 8, 5, "foot", "Number of legs of the tent.", TENT),
    continuous(
        "monoleg_bezier_start_x_offset", 0, 1, 6, 0.5273, "pedestal", "Radius of the pedestal at its top.", PEDESTAL
    ),
    continuous(
        "monoleg_bezier_start_handle_x_offset", 0, 1, 6, 1, "pedestal", "Radius that its upper part turns to.", PEDESTAL
    ),
    continuous(
        "monoleg_bezier_start_handle_z_pct", 0, 1, 6, 0.46, "pedestal", "How far down its upper part reaches.", PEDESTAL
    ),
    continuous(
        "monoleg_bezier_end_x_offset", 0.2, 1, 5, 0.25, "pedestal", "Radius of the pedestal at the ground.", PEDESTAL
    ),
    continuous(
        "monoleg_bezier_end_handle_x_offset",
        0,
        1,
        6,
        0.11,
        "pedestal",
        "Radius that its lower part turns to.",
        PEDESTAL,
    ),
    continuous(
        "monoleg_bezier_end_handle_z_pct", 0, 1, 6, 0.21, "pedestal", "How far down its lower part begins.", PEDESTAL
    ),
)

PROGRAM = Program(
    name="table",
    description="A table on four legs, on a pedestal or on a tent of legs.",
    parameters=PARAMETERS,
    labels=("top", "leg", "support", "pedestal", "column", "plate", "hub", "glide"),
    build=build,
    constraints=(
        Constraint(
            "foot_below_neck",
            Condition("monoleg_bezier_end_x_offset >= monoleg_bezier_start_x_offset"),
            "A pedestal that is narrower at the ground than at its top would topple.",
        ),
    ),
)


def pedestal_parts(table: TableDimensions) -> list[Part]:
    """The parts of the single foot."""
    if not table.values["is_monoleg_tent"]:
        return [_turned(table, table.spread, 0.0)]
    level = table.under * table.values["monoleg_tent_pct"]
    thick = min(0.85 * table.stick, 0.6 * level)
    return [*_column(table, level, thick), *_tent(table, level, thick)]


def _turned(table: TableDimensions, spread: FloatArray, base: float) -> Part:
    """A turned body with the Bezier curve as outline, from its neck under the top to `base`.

    spread: float64 (2,), its greatest half axes
    """
    start, end = (
        (
            0.06 + 0.8 * table.values[f"monoleg_bezier_{name}_handle_x_offset"],
            table.values[f"monoleg_bezier_{name}_handle_z_pct"],
        )
        for name in ("start", "end")
    )
    neck = 0.1 + 0.5 * table.values["monoleg_bezier_start_x_offset"]
    ground = 0.3 + 0.5 * table.values["monoleg_bezier_end_x_offset"]
    outline = bezier([(neck, 0.0), start, end, (ground, 1.0)], count=16).points
    # A vertical lip on the ground, or a flat foot would have a sharp edge.
    lip = 0.05 * (table.under - base)
    heights = table.under + (base + lip - table.under) * outline[:, 1]
    levels = np.concatenate([[table.sunk], heights, [base]])
    radii = np.concatenate([outline[:1, 0], outline[:, 0], outline[-1:, 0]])
    return Part("pedestal", ring_mesh(circle(1.0, 32).points, _axis(levels), radii[:, None] * spread), WALNUT)


def _column(table: TableDimensions, level: float, thick: float) -> list[Part]:
    """The parts above the tent: a turned body where the tent is low, else a column under a plate."""
    if table.values["monoleg_tent_pct"] < 0.4:
        return [_turned(table, np.maximum(0.45 * table.spread, 4.0 * thick), level - 0.6 * thick)]
    section = square_circle(table.values["legs_bevel"], 1.5 * thick).points
    column = ring_mesh(section, _axis(np.array([table.sunk, level])), np.ones(2))
    rim = np.array([table.sunk, table.under - 0.012, table.under - 0.016])
    plate = ring_mesh(circle(1.0, 32).points, _axis(rim), np.array([1.0, 1.0, 0.97])[:, None] * 0.45 * table.spread)
    hub = np.array([0.75, 0.6, -0.6, -0.75]) * thick + level
    boss = ring_mesh(circle(1.5 * thick, 32).points, _axis(hub), np.array([0.9, 1.0, 1.0, 0.9]))
    return [Part("column", column, METAL), Part("plate", plate, METAL), Part("hub", boss, METAL)]


def _tent(table: TableDimensions, level: float, thick: float) -> list[Part]:
    """Legs from the middle at `level` out and down to glides on the ground."""
    count = table.values["monoleg_tent_count"]
    reach = 0.42 + 0.53 * table.values["monoleg_tent_base_radius"]
    section = square_circle(table.values["legs_bevel"], thick, 1.1 * thick)
    foot = 0.6 * thick
    # An even number of legs is symmetric to both axes; with an odd one, a leg is in front.
    turns = np.arange(count) / count + (0.5 / count if count % 2 == 0 else 0.0)
    parts = []
    for angle in (2.0 * np.pi * turns).tolist():
        end = reach * table.spread * [np.sin(angle), np.cos(angle)]
        out = [0.0, 0.45, 0.85, 1.0]
        rise = np.array([level, level, foot + 0.45 * (level - foot), foot])
        rail = bezier(np.column_stack([np.outer(out, end), rise])[:, [0, 2, 1]], count=TENT_LEG_SEGMENTS)
        width = leg_width(table, rail.positions)
        style = Style(rail.positions, np.column_stack([width, width]), np.zeros(len(width)))
        parts.append(Part("leg", sweep(rail, section, style, caps=("flat", "round")), METAL))
        glide = cylinder(0.7 * foot, foot).transformed(translation(end[0], 0.0, end[1]))
        parts.append(Part("glide", glide, METAL))
    return parts


def _axis(heights: FloatArray) -> FloatArray:
    """Points over the origin, float64 (n, 3)."""
    return heights[:, None] * [0.0, 1.0, 0.0]
