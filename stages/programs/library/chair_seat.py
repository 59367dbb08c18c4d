"""The seat of a chair, and its cushion."""

from __future__ import annotations

import numpy as np

from stages.programs.curves import Part, QuadMesh, loft_rings
from stages.programs.library.chair_dimensions import FABRIC, SEAT, ChairDimensions
from stages.shape.arrays import FloatArray

BOARD_RINGS = ((0.985, 0.0), (0.997, 0.12), (1.0, 0.3), (1.0, 0.7), (0.997, 0.88), (0.985, 1.0))
FLAT_RINGS = ((0.97, -0.1), (1.0, 0.15), (1.0, 0.8), (0.98, 0.95), (0.95, 1.0))
PUFFED_RINGS = (
    (0.92, -0.05),
    (0.98, 0.12),
    (1.0, 0.35),
    (0.99, 0.6),
    (0.94, 0.8),
    (0.8, 0.93),
    (0.5, 1.0),
    (0.0, 1.02),
)
"""Rings from the bottom up: relative width and relative height; the bottom of a cushion is inside the seat."""


def seat_parts(chair: ChairDimensions) -> list[Part]:
    """The seat board and, where there is one, the cushion, which ends before the posts of the back."""
    thickness = chair.seat_thickness
    board = _stacked(chair.outline.points, chair.seat_top - thickness, thickness, BOARD_RINGS)
    parts = [Part("seat", board, SEAT)]
    state = int(chair.values["pillow_state"])
    if state:
        outline = chair.outline.points * (0.97 if chair.values["pillow_fill_edge"] else 0.8)
        behind = outline[:, 1] < 0.0
        outline[behind, 1] *= (chair.z - 0.6 * chair.unit) / (0.5 * chair.depth)
        height, rings = (0.8 * chair.unit, FLAT_RINGS) if state == 1 else (1.9 * chair.unit, PUFFED_RINGS)
        parts.append(Part("cushion", _stacked(outline, chair.seat_top, height, rings), FABRIC))
    return parts


def _stacked(outline: FloatArray, base: float, height: float, rings: tuple[tuple[float, float], ...]) -> QuadMesh:
    """A mesh of scaled outlines (k, 2) one above the other."""
    wide, high = np.array(rings).T
    points = np.empty((len(rings), len(outline), 3))
    points[..., 0], points[..., 2] = np.moveaxis(wide[:, None, None] * outline[::-1], 2, 0)
    points[..., 1] = base + height * high[:, None]
    return loft_rings(points)
