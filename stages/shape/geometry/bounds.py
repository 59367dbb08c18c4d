"""The bounding box of a shape."""

from __future__ import annotations

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.geometry.contact import world_boxes
from stages.shape.shape import Shape


def shape_bounds(shape: Shape) -> FloatArray:
    """Return the lowest and highest corner of the box around all parts, float64 (2, 3)."""
    boxes = world_boxes(shape.meshes, shape.assembly.types, shape.assembly.poses)
    return np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])
