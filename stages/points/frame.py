"""How a cloud is brought to a standard place and size."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from stages.shape.geometry.bounds import shape_bounds
from stages.shape.geometry.pose import transform_points
from stages.shape.shape import Shape

NormalizeMode = Literal["none", "unit_sphere", "unit_box"]


@dataclass(frozen=True)
class Normalization:
    """`(points - centre) * scale` moves points of the dataset's coordinates to where a stage puts them."""

    centre: tuple[float, float, float]
    scale: float


def normalization(shape: Shape, mode: NormalizeMode) -> Normalization:
    """How to bring `shape` to a standard place and size.

    `unit_box`: the centre of its box to the origin, its longest side to 1. `unit_sphere`: the same centre to the
    origin, its farthest vertex to distance 1. `none`: nothing moves.
    """
    if mode == "none":
        return Normalization((0.0, 0.0, 0.0), 1.0)
    bounds = shape_bounds(shape)
    centre = bounds.mean(axis=0)
    if mode == "unit_box":
        size = float((bounds[1] - bounds[0]).max())
    else:
        size = max(
            float(np.linalg.norm(transform_points(pose, shape.meshes[index].vertices) - centre, axis=1).max())
            for index, pose in zip(shape.assembly.types, shape.assembly.poses, strict=True)
        )
    x, y, z = centre.tolist()
    return Normalization((x, y, z), 1.0 / size)
