"""Handles of a vase: curves from the wall, clear of it, and back to it or to a free end."""

from __future__ import annotations

import numpy as np

from stages.programs.curves import Part, QuadMesh, Style, polyline, rotation, square_circle, sweep
from stages.programs.library.rails import cubic, eased
from stages.programs.library.vessel import VesselSection, Wall
from stages.programs.schema import Values
from stages.shape.arrays import FloatArray

HANDLE_SEGMENTS, HANDLE_OUTLINE_POINTS = 16, 12


def handles(
    values: Values, wall: Wall, section: VesselSection, body_top: float, color: tuple[int, int, int]
) -> list[Part]:
    """The handles of a vase, evenly around it from +x. body_top: height of the top of the body."""
    size = min(values["body_width"], 0.4 * (body_top - wall.inner[0, 1]))
    path = _path(values, wall, body_top, size)
    angles = 360.0 / max(values["handle_count"], 1) * np.arange(values["handle_count"])
    meshes: dict[float, QuadMesh] = {}
    parts = []
    for angle in angles.tolist():
        # The cross-section is the same in each quarter, and a circle's in each direction.
        kind = 0.0 if values["body_profile_blend"] == 1.0 else round(angle % 90.0, 6)
        if kind not in meshes:
            meshes[kind] = _handle(values, wall, section, path, size, kind)
        parts.append(Part("handle", meshes[kind].transformed(rotation("y", angle)), color))
    return parts


def _path(values: Values, wall: Wall, body_top: float, size: float) -> FloatArray:
    """Distance from the wall and height along the handle, float64 (segments + 1, 2)."""
    foot = float(wall.inner[0, 1])
    start = foot + values["hndl_base_z"] * (body_top - foot)
    room = body_top - start
    leave = np.radians(-45.0 + 100.0 * values["hndl_base_bezier_handle_angle"])
    length = size * (0.4 + 0.9 * values["hndl_base_bezier_handle_length"])
    first = [length * np.cos(leave), start + _bounded(length * np.sin(leave), start)]
    if values["hndl_type"] == 1:
        end = start + room * (0.15 + values["hndl1_top_z"])
        arrive = np.radians(-45.0 + 100.0 * values["hndl1_end_bezier_handle_angle"])
        length = size * (0.4 + 0.9 * values["hndl1_end_bezier_handle_length"])
        second, last = [length * np.cos(arrive), end + length * np.sin(arrive)], [0.0, end]
    else:
        end = start + room * (0.35 + 0.6 * values["hndl2_end_z"])
        # The distance of a free end from the wall is about its own thickness.
        away = 0.8 * _girth(values, size)[0] + 0.9 * size * values["hndl2_end_x"]
        lift = size * (1.3 * values["hndl2_end_bezier_handle_z"] - 0.5)
        second, last = [away + size * (0.25 + 1.1 * values["hndl2_end_bezier_handle_x"]), end + lift], [away, end]
    return cubic([[0.0, start], first, second, last], HANDLE_SEGMENTS)


def _girth(values: Values, size: float) -> tuple[float, float]:
    """Thickness and width of a handle at its start."""
    # A square handle is a strap, a round one a cord.
    strap = 1.45 - 0.8 * values["hndl_profile_blend"]
    thick, wide = 0.07 + 0.17 * values["hndl_profile_height"], 0.08 + 0.22 * values["hndl_profile_width"]
    return size * thick, size * strap * wide


def _bounded(rise: float, room: float) -> float:
    """A rise, or a fall that is less than the room below."""
    return rise if rise >= 0.0 else -room * (1.0 - float(np.exp(rise / room)))


def _leaving(path: FloatArray, distance: float, free: bool) -> FloatArray:
    """The path without the points nearer to the wall than `distance` next to its ends on the wall."""
    away = np.flatnonzero(path[:, 0] > distance)
    if len(away) == 0:
        away = np.array([path[:, 0].argmax()])
    last = len(path) - 1 if free else away[-1] + 1
    return np.concatenate([path[:1], path[max(away[0], 1) : last], path[-1:]])


def _handle(
    values: Values, wall: Wall, section: VesselSection, path: FloatArray, size: float, angle: float
) -> QuadMesh:
    """The handle towards +x, for the shape of the wall at `angle`."""
    free = values["hndl_type"] == 2
    thick, wide = _girth(values, size)
    path = _leaving(path, 0.75 * thick, free)
    heights = path[:, 1]
    clear = _cover(wall, heights)
    t = np.linspace(0.0, 1.0, len(path))
    ends = wall.radius(heights[[0, -1]]) - clear[[0, -1]]
    clear = clear + (1.0 - t) ** 5 * ends[0] + (0.0 if free else t**5 * ends[1])
    swell = 0.25 + 1.75 * values["hndl_radius_along_path"]
    last = 0.5 + 0.5 * swell if free else 1.0
    rise = np.sin(np.pi * t) ** 2
    scale = np.where(t < 0.5, 1.0, last) * (1.0 - rise) + swell * rise
    out = section.reach(angle) * clear + path[:, 0]
    rail = polyline(eased(np.column_stack([out, heights, np.zeros_like(t)]), 0.5 * thick * scale))
    style = Style(rail.positions, np.stack([scale, scale], axis=1), np.zeros_like(t))
    profile = square_circle(0.16 + 0.84 * values["hndl_profile_blend"], thick, wide, count=HANDLE_OUTLINE_POINTS)
    # The profile's y is the world's z, which is perpendicular to the curve.
    mesh = sweep(rail, profile, style, up=(0.0, 0.0, 1.0), caps=("flat", "round") if free else "flat")
    return _grown_on(mesh, wall, section, angle, free)


def _grown_on(mesh: QuadMesh, wall: Wall, section: VesselSection, angle: float, free: bool) -> QuadMesh:
    """The handle with its ends in the middle of the wall, and no part of it further inside."""
    x, y, z = mesh.vertices.T
    depth = wall.radius(y) - 0.5 * wall.thickness
    within = x
    for _ in range(2):
        radius = depth * section.reach(angle + np.degrees(np.arctan2(-z, within)))
        within = np.sqrt(np.maximum(radius * radius - z * z, 0.09 * radius * radius))
    # Not all the way: where the wall is horizontal, points of a ring would coincide.
    within = x + 0.9 * (within - x)
    moved = np.maximum(x, within)
    rings = len(x) - 2
    moved[:HANDLE_OUTLINE_POINTS], moved[-2] = within[:HANDLE_OUTLINE_POINTS], within[-2]
    if not free:
        moved[rings - HANDLE_OUTLINE_POINTS : rings], moved[-1] = (
            within[rings - HANDLE_OUTLINE_POINTS : rings],
            within[-1],
        )
    return QuadMesh(np.column_stack([moved, y, z]), mesh.quads)


def _cover(wall: Wall, heights: FloatArray) -> FloatArray:
    """The radius of the convex hull of the wall over the range of `heights` (n,), at each of them."""
    low, high = float(heights.min()), float(heights.max())
    between = wall.outer[(wall.outer[:, 1] > low) & (wall.outer[:, 1] < high)]
    first, last = wall.radius(np.array([low, high])).tolist()
    points = [(low, first), *((y, x) for x, y in between.tolist()), (high, last)]
    cover: list[tuple[float, float]] = []
    for point in sorted(points):
        while len(cover) > 1 and _turns_left(cover[-2], cover[-1], point):
            cover.pop()
        cover.append(point)
    at, radii = np.array(cover).T
    reach: FloatArray = np.interp(heights, at, radii)
    return reach


def _turns_left(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> bool:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) >= 0.0
