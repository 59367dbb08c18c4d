"""The seat of a chair, and its cushion."""

from __future__ import annotations

import numpy as np

from stages.programs.chair_plan import FABRIC, SEAT, Plan
from stages.programs.curves import Part, extrude, loft_rings

__all__ = ["seat_parts"]

FLAT = ((0.97, -0.1), (1.0, 0.15), (1.0, 0.8), (0.98, 0.95), (0.95, 1.0))
PUFFED = ((0.92, -0.05), (0.98, 0.12), (1.0, 0.35), (0.99, 0.6), (0.94, 0.8), (0.8, 0.93), (0.5, 1.0), (0.0, 1.02))
"""Rings of a cushion from below: how wide, and how high as a share of its height; its foot is sunk into the seat."""


def seat_parts(plan: Plan) -> list[Part]:
    """The seat board and, where there is one, the cushion, which ends before the posts of the back."""
    thickness = plan.seat_thickness
    board = extrude(plan.outline, thickness, base=plan.seat_top - thickness, bevel=0.3 * thickness, steps=2)
    parts = [Part("seat", board, SEAT)]
    state = int(plan.values["pillow_state"])
    if state:
        outline = plan.outline.points * (0.97 if plan.values["pillow_fill_edge"] else 0.8)
        behind = outline[:, 1] < 0.0
        outline[behind, 1] *= (plan.z - 0.6 * plan.unit) / (0.5 * plan.depth)
        height, rings = (0.8 * plan.unit, FLAT) if state == 1 else (1.9 * plan.unit, PUFFED)
        wide, high = np.array(rings).T
        cushion = np.empty((len(rings), len(outline), 3))
        cushion[..., 0] = wide[:, None] * outline[:, 0]
        cushion[..., 1] = plan.seat_top + height * high[:, None]
        cushion[..., 2] = wide[:, None] * outline[:, 1]
        parts.append(Part("cushion", loft_rings(cushion[:, ::-1]), FABRIC))
    return parts
