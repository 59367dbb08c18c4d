"""The back of a chair: posts, and between them cross rails, vertical rails or an upholstered panel, and a top rail."""

from __future__ import annotations

import numpy as np

from stages.programs.curves import (
    Curve,
    Part,
    Style,
    polyline,
    rounded_rectangle,
    solidify,
    square_circle,
    sweep,
    symmetric,
)
from stages.programs.library.chair_plan import FABRIC, SEAT, WOOD, Plan, post
from stages.shape.arrays import FloatArray

__all__ = ["back_parts"]

ACROSS = np.linspace(-1.0, 1.0, 9)
"""Relative distances from the middle at which a rail has rings."""


def back_parts(plan: Plan) -> list[Part]:
    """The posts and what they hold; ends of rails are sunk into the posts, feet into the seat."""
    values = plan.values
    share = np.linspace(0.0, 1.0, 9)
    centers = plan.back(plan.x, share)
    foot = np.array([[plan.x, plan.seat_middle, -plan.z]])
    profile = square_circle(float(values["legs_bevel"]), 1.05 * plan.unit)
    side = post(np.concatenate([foot, centers]), profile, np.concatenate([[1.0], 1.0 - 0.2 * share]))
    parts = symmetric([Part("back post", side, WOOD)], "x")
    if values["is_top_rail"]:
        parts.append(_top_rail(plan))
    if values["is_back_rest"]:
        parts.append(_panel(plan))
    elif values["is_top_rail"] and values["is_vertical_rail"]:
        parts += _vertical_rails(plan)
    else:
        parts += _cross_rails(plan)
    return parts


def _top_height(plan: Plan) -> float:
    """Height of the top rail at its ends."""
    return min(1.9 * plan.unit, 0.15 * plan.back_height) * float(plan.values["tr_scale_z"])


def _top_level(plan: Plan) -> float:
    """Relative height of the middle of the top rail's ends: above the posts if it covers them, else between them."""
    height = _top_height(plan)
    beyond = 0.35 * height if plan.values["tr_fill_edge"] else -0.5 * height - 0.1 * plan.unit
    return 1.0 + beyond / plan.back_height


def _room(plan: Plan) -> float:
    """The relative height up to which there is room below the top rail, or below the tops of the posts."""
    if not plan.values["is_top_rail"]:
        return 0.99
    return _top_level(plan) - 0.5 * _top_height(plan) / plan.back_height


def _rise(plan: Plan, x: FloatArray) -> FloatArray:
    """How far the top rail is arched upwards at distances from the middle, (n,)."""
    arch = float(plan.values["tr_shape_1"]) * (0.5 * _top_height(plan) + 0.12 * plan.x)
    return arch * np.maximum(1.0 - (x / plan.x) ** 2, 0.0)


def _top_rail(plan: Plan) -> Part:
    level, height = _top_level(plan), _top_height(plan)
    x = plan.x * ACROSS
    if plan.values["tr_fill_edge"]:
        end = plan.x + 0.75 * plan.unit
        x = np.concatenate([[-end], x, [end]])
    up = plan.up(level)
    rise = _rise(plan, x)
    rail = polyline(plan.back(x, level) + rise[:, None] * up)
    depth = 0.8 * plan.unit * float(plan.values["tr_scale_y"])
    profile = rounded_rectangle(depth, height, 0.3 * min(depth, height), 2)
    swell = 1.0 + 0.5 * float(plan.values["tr_shape_1"]) * (rise / max(rise.max(), 1e-9))
    return Part("top rail", sweep(rail, profile, _styled(rail, 1.0, swell), up=up), WOOD)


def _styled(rail: Curve, x: float | FloatArray, y: float | FloatArray) -> Style:
    """A scale of the profile at each point of the rail."""
    scale = np.empty((len(rail.points), 2))
    scale[:, 0], scale[:, 1] = x, y
    positions = rail.positions
    return Style(positions, scale, np.zeros(len(positions)))


def _cross_rails(plan: Plan) -> list[Part]:
    """Slats from post to post; they share the room from the lowest to the highest and never touch each other."""
    values = plan.values
    count, size = int(values["cr_count"]), float(values["cr_scale_z"])
    room = _room(plan)
    low, high = room * float(values["cr_offset_bottom"]), room * float(values["cr_offset_top"])
    pitch = plan.back_height * (high - low) / (count - 1)
    height = min(size * min(0.9 * plan.unit, 0.055 * plan.back_height), (0.25 + 0.3 * size) * pitch)
    profile = square_circle(float(values["bevel_rails"]), 0.55 * plan.unit * float(values["cr_scale_y"]), height, 12)
    # Arched: the ends lie lower than the middle, the lowest ones still above the seat.
    shape = float(values["cr_shape_1"])
    drop, lens = 0.045 * shape * ACROSS**2, 1.0 - 0.15 * shape * ACROSS**2
    parts = []
    for level in np.linspace(low, high, count).tolist():
        rail = polyline(plan.back(plan.x * ACROSS, level - drop))
        parts.append(Part("cross rail", sweep(rail, profile, _styled(rail, 1.0, lens), up=plan.up(level)), SEAT))
    return parts


def _vertical_rails(plan: Plan) -> list[Part]:
    """Spindles from the seat up into the top rail."""
    values = plan.values
    count, size = int(values["vr_count"]), float(values["vr_scale_x"])
    spacing = 2.0 * plan.x / (count + 1)
    width = min(0.6 * plan.unit * size, (0.2 + 0.3 * size) * spacing)
    profile = square_circle(float(values["bevel_rails"]), width, 0.65 * plan.unit * float(values["vr_scale_y"]), 12)
    share = np.linspace(0.0, 1.0, 8)
    bulge = 1.0 - 1.6 * float(values["vr_shape_1"]) * (2.0 * share - 1.0) ** 2
    level = _top_level(plan)
    parts = []
    for x in (spacing * (np.arange(1, count + 1) - (count + 1) / 2.0)).tolist():
        top = level + float(_rise(plan, np.array([x]))[0]) / plan.back_height
        centers = plan.back(x, top * share)
        centers[0, 1] = plan.seat_middle
        parts.append(Part("vertical rail", post(centers, profile, bulge), SEAT))
    return parts


def _panel(plan: Plan) -> Part:
    """An upholstered panel between the posts, thin at its upper and lower edge; it follows the arch of a top rail."""
    low, high = 0.13, np.full(len(ACROSS), _room(plan))
    if plan.values["is_top_rail"]:
        high += (0.4 * _top_height(plan) + 0.8 * _rise(plan, plan.x * ACROSS)) / plan.back_height
    angles = np.linspace(0.0, np.pi, 9)
    levels = low + (high[:, None] - low) * (1.0 - np.cos(angles)) / 2.0
    grid = plan.back(plan.x * ACROSS[:, None], levels)
    thickness = plan.unit * (0.3 + 0.75 * np.sqrt(np.maximum(np.sin(angles), 0.0)))
    return Part("backrest", solidify(grid, np.broadcast_to(thickness, grid.shape[:2])), FABRIC)
