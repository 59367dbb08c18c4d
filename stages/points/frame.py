"""Normalise a cloud to a standard position and size."""

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
    """`(points - centre) * scale` moves points from the dataset's coordinates to the normalised ones."""

    centre: tuple[float, float, float]
    scale: float


def normalization(shape: Shape, mode: NormalizeMode) -> Normalization:
    """Return how to bring `shape` to a standard position and size.

    `unit_box`: centre of its box to the origin, longest side to 1. `unit_sphere`: the same centre to the origin,
    farthest vertex to distance 1. `none`: unchanged.
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
