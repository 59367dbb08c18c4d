"""The arms of a chair: free, on a support, or in one curve from the back down to the seat; and their pads."""

from __future__ import annotations

import numpy as np

from stages.programs.curves import Curve, Part, bezier, polyline, square_circle, sweep, symmetric
from stages.programs.library.chair_dimensions import LEATHER, WOOD, ChairDimensions
from stages.programs.library.rails import cubic, eased
from stages.shape.arrays import FloatArray

UP_DIRECTION = np.array([0.0, 1.0, 0.0])


def arm_parts(chair: ChairDimensions) -> list[Part]:
    """Both arms with their supports and pads, attached to the posts of the back and to the sides of the seat."""
    values = chair.values
    state = int(values["handles_state"])
    if not state:
        return []
    width = chair.unit * (2.0 * float(values["handles_profile_width"]) - 0.35)
    height = chair.unit * (2.1 * float(values["handles_profile_height"]) - 0.6)
    arm = _arm(chair, state, width, height)
    profile = square_circle(0.4, width, height, 12)
    parts = [Part("arm", sweep(arm, profile, up=UP_DIRECTION, caps=("flat", "round" if state == 1 else "flat")), WOOD)]
    if state == 1 and values["is_handles_support"]:
        parts.append(_support(chair, arm))
    if values["is_handles_cusion"]:
        parts.append(_pad(chair, arm, state, width, height))
    return symmetric(parts, "x")


def _arm(chair: ChairDimensions, state: int, width: float, height: float) -> Curve:
    """The right arm from the post forwards, for a section of this width and height."""
    values = chair.values
    # Arms leave room for a cushion.
    above = 2.4 * chair.unit
    rest = chair.back_height - above
    share = float(values["handles_base_pos_z_pct"])
    start = chair.back(chair.x, (above + rest * share) / chair.back_height)
    start[0] += 0.3 * chair.unit
    bow = 0.4 * min(chair.width, chair.depth)
    front = 0.95 * chair.z
    lift = (float(values["handles_mid_pos_z_pct"]) - 0.5) * 0.8 * rest * min(share, 0.45)
    side = 0.5 * chair.width + bow * float(values["handles_mid_pos_x_pct"])
    if state == 2:
        front += 0.2 * chair.depth
    forward = start[2] + (front - start[2]) * (0.1 + 0.8 * float(values["handles_mid_pos_y_pct"]))
    middle = np.array([side, start[1] + lift, forward])
    if state == 2:
        points = cubic([start, middle, middle, _foot(chair, width)], 16)
        return polyline(eased(points, np.full(17, 0.5 * np.hypot(width, height))))
    end = np.array([chair.x + bow * float(values["handles_edge_pos_x_pct"]), start[1], front])
    # With full handles, the free end would be a hook where end and middle are near each other.
    points = cubic([start, start + (middle - start) / 1.5, end + (middle - end) / 1.5, end], 12)
    return polyline(eased(points, np.full(13, 0.5 * np.hypot(width, height))))


def _foot(chair: ChairDimensions, width: float) -> FloatArray:
    """The end of an arm or a support of this width in the right side of the seat, next to the cushion, (3,)."""
    z = chair.z * (2.0 * float(chair.values["handles_bottom_pos_along_seat_pct"]) - 1.0)
    return np.array([chair.rim(z) + 0.5 * width - 0.2 * chair.unit, chair.seat_middle, z])


def _support(chair: ChairDimensions, arm: Curve) -> Part:
    """The post below the right arm."""
    values = chair.values
    size = chair.unit * (2.1 * float(values["handles_support_thickness"]) - 0.49)
    foot, top = _foot(chair, size), arm.at(float(values["handles_support_top_pos"]))
    bow = np.array(
        [
            0.3 * min(chair.width, chair.depth) * float(values["handles_support_mid_x"]),
            0.0,
            0.3 * chair.depth * float(values["handles_support_mid_y"]),
        ]
    )
    middle = (foot + top) / 2.0 + bow
    rail = bezier([foot, middle, middle, top], count=8)
    return Part("arm support", sweep(rail, square_circle(0.5, size, count=12)), WOOD)


def _pad(chair: ChairDimensions, arm: Curve, state: int, width: float, height: float) -> Part:
    """The pad on top of the right arm."""
    cover = float(chair.values["handles_cusion_cover_pct"])
    middle, half = (0.53, 0.11 + 0.31 * cover) if state == 1 else (0.36, 0.08 + 0.19 * cover)
    start, end = middle - half, middle + half
    profile = square_circle(0.6, 1.2 * width, 0.7 * chair.unit, 12)
    covered = arm.part(start, end)
    above = covered.frames(covered.positions, up=arm.frames(start, up=UP_DIRECTION)[:3, 1])[:, :3, 1]
    points = covered.points + (0.5 * height + 0.1 * chair.unit) * above
    rail = polyline(eased(points, np.full(len(points), 0.5 * np.hypot(*profile.size))))
    return Part("arm pad", sweep(rail, profile, up=above[0], caps="round"), LEATHER)
