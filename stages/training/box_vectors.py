"""Cuboids as numbers, for models that write cuboids and no programs: where each stands, how large, how turned."""

from __future__ import annotations

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shapeassembly.execution.parameters import MIN_CUBOID_SIZE
from stages.shapeassembly.extraction.boxes import nearest_axes
from stages.shapeassembly.extraction.hierarchy import Box

CENTRE, SIZE, TURN = slice(0, 3), slice(3, 6), slice(6, 9)
BOX_WIDTH = 9

MIN_TURN_RADIANS = 0.02
"""Cuboids that are turned by less stand upright; in radians."""


def box_vector(box: Box) -> FloatArray:
    """Centre, sizes and the rotation vector of a box, float64 (9,): its axes are called by the axes of space that they
    are nearest to, so that an upright box is not turned."""
    from scipy.spatial.transform import Rotation

    named = nearest_axes(box, np.eye(3))
    turn = Rotation.from_matrix(named.axes.T).as_rotvec()
    if np.linalg.norm(turn) < MIN_TURN_RADIANS:
        turn = np.zeros(3)
    return np.concatenate([named.center, named.size, turn])


def box_from_vector(numbers: FloatArray) -> Box:
    """The box of such numbers, (9,), its sizes no smaller than a program's may be."""
    from scipy.spatial.transform import Rotation

    turn = numbers[TURN].astype(float)
    axes = Rotation.from_rotvec(turn if np.linalg.norm(turn) >= MIN_TURN_RADIANS else np.zeros(3)).as_matrix().T
    return Box(numbers[CENTRE].astype(float), np.maximum(numbers[SIZE].astype(float), MIN_CUBOID_SIZE), axes)
