"""Cuboids as vectors of nine numbers, for models that generate cuboids instead of programs."""

from __future__ import annotations

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shapeassembly.execution.parameters import MIN_CUBOID_SIZE
from stages.shapeassembly.extraction.boxes import nearest_axes
from stages.shapeassembly.extraction.hierarchy import Box

CENTER, SIZE, ROTATION = slice(0, 3), slice(3, 6), slice(6, 9)
BOX_WIDTH = 9

MIN_TURN_RADIANS = 0.02
"""A smaller rotation counts as none."""


def box_vector(box: Box) -> FloatArray:
    """Return centre, sizes and rotation vector of a box, float64 (9,).

    Axes are named after the nearest axes of space, so that an upright box is not rotated.
    """
    from scipy.spatial.transform import Rotation

    named = nearest_axes(box, np.eye(3))
    rotation = Rotation.from_matrix(named.axes.T).as_rotvec()
    if np.linalg.norm(rotation) < MIN_TURN_RADIANS:
        rotation = np.zeros(3)
    return np.concatenate([named.center, named.size, rotation])


def box_from_vector(vector: FloatArray) -> Box:
    """Return the box of a vector (9,), with sizes no smaller than a program's may be."""
    from scipy.spatial.transform import Rotation

    rotation = vector[ROTATION].astype(float)
    axes = Rotation.from_rotvec(rotation if np.linalg.norm(rotation) >= MIN_TURN_RADIANS else np.zeros(3))
    size = np.maximum(vector[SIZE].astype(float), MIN_CUBOID_SIZE)
    return Box(vector[CENTER].astype(float), size, axes.as_matrix().T)
