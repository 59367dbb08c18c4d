"""The arms of a chair: free or held up by a support, or one curve from the back down to the seat; and their pads."""

from __future__ import annotations

import numpy as np

from stages.programs.curves import Curve, Part, bezier, square_circle, sweep, symmetric
from stages.programs.library.chair_plan import LEATHER, WOOD, Plan
from stages.shape.arrays import FloatArray

__all__ = ["arm_parts"]

UP = np.array([0.0, 1.0, 0.0])


def arm_parts(plan: Plan) -> list[Part]:
    """Both arms with all that belongs to them, attached to the posts of the back and to the seat's sides."""
    values = plan.values
    state = int(values["handles_state"])
    if not state:
        return []
    width = 1.4 * plan.unit * float(values["handles_profile_width"])
    height = 1.05 * plan.unit * float(values["handles_profile_height"])
    arm = _arm(plan, state, width)
    profile = square_circle(0.4, width, height, 12)
    parts = [Part("arm", sweep(arm, profile, up=UP, caps=("flat", "round" if state == 1 else "flat")), WOOD)]
    if state == 1 and values["is_handles_support"]:
        parts.append(_support(plan, arm))
    if values["is_handles_cusion"]:
        parts.append(_pad(plan, arm, state, width, height))
    return symmetric(parts, "x")


def _arm(plan: Plan, state: int, width: float) -> Curve:
    """The right arm from the post forwards."""
    values = plan.values
    # Arms leave room for a cushion.
    above = 2.2 * plan.unit
    rest = plan.back_height - above
    share = float(values["handles_base_pos_z_pct"])
    start = plan.back(plan.x, (above + rest * share) / plan.back_height)
    start[0] += 0.3 * plan.unit
    bow = 0.4 * min(plan.width, plan.depth)
    front = 0.95 * plan.z
    lift = (float(values["handles_mid_pos_z_pct"]) - 0.5) * 0.8 * rest * min(share, 0.45)
    side = 0.5 * plan.width + bow * float(values["handles_mid_pos_x_pct"])
    if state == 2:
        front += 0.2 * plan.depth
    forward = start[2] + (front - start[2]) * (0.1 + 0.8 * float(values["handles_mid_pos_y_pct"]))
    middle = np.array([side, start[1] + lift, forward])
    if state == 2:
        return bezier([start, middle, middle, _foot(plan, width)], count=16)
    end = np.array([plan.x + bow * float(values["handles_edge_pos_x_pct"]), start[1], front])
    # Gently towards the middle, or the free end would be a hook where both are near each other.
    return bezier([start, start + (middle - start) / 1.5, end + (middle - end) / 1.5, end], count=12)


def _foot(plan: Plan, width: float) -> FloatArray:
    """Where an arm or a support of this width is sunk into the right side of the seat, beside the cushion, (3,)."""
    z = plan.z * (2.0 * float(plan.values["handles_bottom_pos_along_seat_pct"]) - 1.0)
    return np.array([plan.rim(z) + 0.5 * width - 0.2 * plan.unit, plan.seat_middle, z])


def _support(plan: Plan, arm: Curve) -> Part:
    """The post below the right arm."""
    values = plan.values
    size = plan.unit * float(values["handles_support_thickness"])
    foot, top = _foot(plan, size), arm.at(float(values["handles_support_top_pos"]))
    bow = np.array(
        [
            0.3 * min(plan.width, plan.depth) * float(values["handles_support_mid_x"]),
            0.0,
            0.3 * plan.depth * float(values["handles_support_mid_y"]),
        ]
    )
    middle = (foot + top) / 2.0 + bow
    rail = bezier([foot, middle, middle, top], count=8)
    return Part("arm support", sweep(rail, square_circle(0.5, size, count=12)), WOOD)


def _pad(plan: Plan, arm: Curve, state: int, width: float, height: float) -> Part:
    """The pad on top of the right arm."""
    cover = float(plan.values["handles_cusion_cover_pct"])
    middle, half = (0.53, 0.11 + 0.31 * cover) if state == 1 else (0.36, 0.08 + 0.19 * cover)
    start, end = middle - half, middle + half
    profile = square_circle(0.6, 1.2 * width, 0.7 * plan.unit, 12).moved(0.0, 0.5 * height + 0.1 * plan.unit)
    lean = arm.frames(start, up=UP)[:3, 1]
    return Part("arm pad", sweep(arm.part(start, end), profile, up=lean, caps="round"), LEATHER)
