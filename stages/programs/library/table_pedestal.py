"""A single foot in the middle of a table: a turned pedestal, or a column on a tent of legs."""

from __future__ import annotations

import numpy as np

from stages.programs.curves import Part, Style, bezier, circle, cylinder, square_circle, sweep, translation
from stages.programs.library.table_dimensions import METAL, WALNUT, TableDimensions, upright
from stages.programs.library.table_legs import leg_width
from stages.shape.arrays import FloatArray

TENT_LEG_SEGMENTS = 10


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
    return Part("pedestal", upright(circle(1.0, 32).points, _axis(levels), radii[:, None] * spread), WALNUT)


def _column(table: TableDimensions, level: float, thick: float) -> list[Part]:
    """The parts above the tent: a turned body where the tent is low, else a column under a plate."""
    if table.values["monoleg_tent_pct"] < 0.4:
        return [_turned(table, np.maximum(0.45 * table.spread, 4.0 * thick), level - 0.6 * thick)]
    section = square_circle(table.values["legs_bevel"], 1.5 * thick).points
    column = upright(section, _axis(np.array([table.sunk, level])), np.ones(2))
    rim = np.array([table.sunk, table.under - 0.012, table.under - 0.016])
    plate = upright(circle(1.0, 32).points, _axis(rim), np.array([1.0, 1.0, 0.97])[:, None] * 0.45 * table.spread)
    hub = np.array([0.75, 0.6, -0.6, -0.75]) * thick + level
    boss = upright(circle(1.5 * thick, 32).points, _axis(hub), np.array([0.9, 1.0, 1.0, 0.9]))
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
