"""Colours by label for shapes that are one blob: where all that they are made of has one colour, or nearly."""

from __future__ import annotations

import numpy as np

from stages.shape.arrays import ByteArray
from stages.shape.shape import Shape
from stages.shape.views.palette import label_colors

MAX_COLOR_RANGE = 12
"""Levels by which colours that count as one differ at most."""


def part_paint(shape: Shape) -> ByteArray | None:
    """A colour for each part by its label, uint8 (n, 3) sRGB, where the meshes show several labels in one colour;
    None where they have colours of their own, which say more."""
    if len(shape.labels) < 2:
        return None
    colors = np.concatenate([mesh.face_colors for mesh in shape.meshes])
    if np.ptp(colors, axis=0).max() > MAX_COLOR_RANGE:
        return None
    painted: ByteArray = label_colors(len(shape.labels))[shape.part_labels]
    return painted
