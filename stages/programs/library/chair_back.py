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
from stages.programs.library.chair_dimensions import FABRIC, SEAT, WOOD, ChairDimensions, post, section
from stages.programs.library.rails import eased
from stages.shape.arrays import FloatArray

ACROSS = np.linspace(-1.0, 1.0, 9)
"""Relative distances of a rail's rings from its middle."""


def back_parts(chair: ChairDimensions) -> list[Part]:
    """The posts, and rails or panel; ends of rails are inside the posts, ends of posts inside the seat."""
    values = chair.values
    share = np.linspace(0.0, 1.0, 9)
    centers = chair.back(chair.x, share)
    foot = np.array([[chair.x, chair.seat_middle, -chair.z]])
    side = post(np.concatenate([foot, centers]), section(chair, 1.05), np.concatenate([[1.0], 1.0 - 0.2 * share]))
    parts = symmetric([Part("back post", side, WOOD)], "x")
    if values["is_top_rail"]:
        parts.append(_top_rail(chair))
    if values["is_back_rest"]:
        parts.append(_panel(chair))
    elif values["is_top_rail"] and values["is_vertical_rail"]:
        parts += _vertical_rails(chair)
    else:
        parts += _cross_rails(chair)
    return parts


def _top_height(chair: ChairDimensions) -> float:
    """Height of the top rail at its ends."""
    return min(1.9 * chair.unit, 0.15 * chair.back_height) * float(chair.values["tr_scale_z"])


def _top_level(chair: ChairDimensions) -> float:
    """Relative height of the middle of the top rail at its ends: above the posts if it covers them, else between."""
    height = _top_height(chair)
    beyond = 0.35 * height if chair.values["tr_fill_edge"] else -0.5 * height - 0.1 * chair.unit
    return 1.0 + beyond / chair.back_height


def _room(chair: ChairDimensions) -> float:
    """The relative height of the free space below the top rail, or below the tops of the posts."""
    if not chair.values["is_top_rail"]:
        return 0.99
    return _top_level(chair) - 0.5 * _top_height(chair) / chair.back_height


def _rise(chair: ChairDimensions, x: FloatArray) -> FloatArray:
    """The arch of the top rail at distances from the middle, (n,)."""
    arch = float(chair.values["tr_shape_1"]) * (0.5 * _top_height(chair) + 0.12 * chair.x)
    return arch * np.maximum(1.0 - (x / chair.x) ** 2, 0.0)


def _top_rail(chair: ChairDimensions) -> Part:
    level, height = _top_level(chair), _top_height(chair)
    x = chair.x * ACROSS
    if chair.values["tr_fill_edge"]:
        end = chair.x + 0.75 * chair.unit
        x = np.concatenate([[-end], x, [end]])
    up = chair.up(level)
    rise = _rise(chair, x)
    depth = chair.unit * (1.3 * float(chair.values["tr_scale_y"]) - 0.3)
    swell = 1.0 + 0.5 * float(chair.values["tr_shape_1"]) * (rise / max(rise.max(), 1e-9))
    reach = 0.5 * np.hypot(depth, height * swell)
    rail = polyline(eased(chair.back(x, level) + rise[:, None] * up, reach))
    profile = rounded_rectangle(depth, height, 0.3 * min(depth, height), 2)
    return Part("top rail", sweep(rail, profile, _styled(rail, 1.0, swell), up=up), WOOD)


def _styled(rail: Curve, x: float | FloatArray, y: float | FloatArray) -> Style:
    """A scale of the profile at each point of the rail."""
    scale = np.empty((len(rail.points), 2))
    scale[:, 0], scale[:, 1] = x, y
    positions = rail.positions
    return Style(positions, scale, np.zeros(len(positions)))


def _turned(chair: ChairDimensions, share: FloatArray, size: tuple[float, float], room: float) -> FloatArray:
    """The scale of a rail's section of a `size` (2,), at shares of its length, float64 (n, 2).

    A round rail is turned on a lathe: it swells towards its middle, by at most `room` in the second direction.
    """
    girth = 0.95 * chair.unit * float(chair.values["bevel_rails"])
    swell = 4.0 * share * (1.0 - share)
    scale: FloatArray = 1.0 + swell[:, None] * (np.array([girth, min(girth, room)]) / size)
    return scale


def _cross_rails(chair: ChairDimensions) -> list[Part]:
    """Slats from post to post, evenly spaced without touching each other."""
    values = chair.values
    count = int(values["cr_count"])
    room = _room(chair)
    low, high = room * float(values["cr_offset_bottom"]), room * float(values["cr_offset_top"])
    # Each slat fills a share of its slot.
    slot = chair.back_height * (high - low) / count
    height = (0.525 * float(values["cr_scale_z"]) - 0.08) * slot
    size = chair.unit * (1.2 * float(values["cr_scale_y"]) - 0.32), height
    half = 0.5 * height / chair.back_height
    profile = square_circle(float(values["bevel_rails"]), *size, 12)
    # Arched: the ends are lower than the middle, but above the seat.
    shape = float(values["cr_shape_1"])
    drop, lens = 0.045 * shape * ACROSS**2, 1.0 - 0.15 * shape * ACROSS**2
    scale = _turned(chair, (ACROSS + 1.0) / 2.0, size, 0.7 * (slot - height))
    scale[:, 1] *= lens
    parts = []
    for level in np.linspace(low + half, high - half, count).tolist():
        rail = polyline(chair.back(chair.x * ACROSS, level - drop))
        swept = sweep(rail, profile, Style(rail.positions, scale, np.zeros(len(scale))), up=chair.up(level))
        parts.append(Part("cross rail", swept, SEAT))
    return parts


def _vertical_rails(chair: ChairDimensions) -> list[Part]:
    """Spindles from the seat up into the top rail."""
    values = chair.values
    count, shape = int(values["vr_count"]), float(values["vr_shape_1"])
    spacing = 2.0 * chair.x / (count + 1)
    size = 0.41 * float(values["vr_scale_x"]) * spacing, chair.unit * float(values["vr_scale_y"])
    profile = square_circle(float(values["bevel_rails"]), *size, 12)
    share = np.linspace(0.0, 1.0, 9)
    scale = _turned(chair, share, size[::-1], 0.6 * (spacing - size[0]))[:, ::-1]
    scale *= 1.0 - 1.5 * shape * (2.0 * share[:, None] - 1.0) ** 2
    # They bow towards the sitter, but end in the plane of the back.
    bow = 0.16 * shape * chair.back_height * (4.0 * share * (1.0 - share)) ** 2
    level = _top_level(chair)
    parts = []
    for x in (spacing * (np.arange(1, count + 1) - (count + 1) / 2.0)).tolist():
        top = level + float(_rise(chair, np.array([x]))[0]) / chair.back_height
        centers = chair.back(x, top * share) + bow[:, None] * [0.0, 0.0, 1.0]
        centers[0, 1] = chair.seat_middle
        parts.append(Part("vertical rail", post(centers, profile, scale), SEAT))
    return parts


def _panel(chair: ChairDimensions) -> Part:
    """An upholstered panel between the posts, thin at its upper and lower edge; it follows the arch of the top rail."""
    low, high = 0.13, np.full(len(ACROSS), _room(chair))
    if chair.values["is_top_rail"]:
        high += (0.4 * _top_height(chair) + 0.8 * _rise(chair, chair.x * ACROSS)) / chair.back_height
    angles = np.linspace(0.0, np.pi, 9)
    levels = low + (high[:, None] - low) * (1.0 - np.cos(angles)) / 2.0
    grid = chair.back(chair.x * ACROSS[:, None], levels)
    thickness = chair.unit * (0.3 + 0.75 * np.sqrt(np.maximum(np.sin(angles), 0.0)))
    return Part("backrest", solidify(grid, np.broadcast_to(thickness, grid.shape[:2])), FABRIC)
