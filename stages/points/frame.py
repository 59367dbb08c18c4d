"""The coordinates of everything a dataset holds: the y axis points up, lengths are the kit's units."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.contact import world_boxes
from stages.shape.kit import Assembly, Kit, PartType
from stages.shape.pose import transform_points

__all__ = ["Normalization", "assembly_bounds", "normalization", "upright"]

Z_TO_Y = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])

NormalizeMode = Literal["none", "unit_sphere", "unit_box"]


@dataclass(frozen=True)
class Normalization:
    """`(points - centre) * scale` moves points of the dataset's coordinates to where a stage puts them."""

    centre: tuple[float, float, float]
    scale: float


def upright(assembly: Assembly, kit: Kit) -> Assembly:
    """`assembly` turned so that y points up, which is a quarter turn about x for a kit whose z points up."""
    if kit.up == "y":
        return assembly
    # adding zero turns the minus zeros of the product into zeros, which read better in text
    return replace(assembly, poses=Z_TO_Y @ assembly.poses + 0.0)


def assembly_bounds(types: Sequence[PartType], assembly: Assembly) -> FloatArray:
    """Lowest and highest corner of the box around all parts, float64 (2, 3)."""
    boxes = world_boxes(types, assembly.types, assembly.poses)
    return np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])


def normalization(types: Sequence[PartType], assembly: Assembly, mode: NormalizeMode) -> Normalization:
    """How to bring `assembly` to a standard place and size.

    `unit_box`: the centre of its box to the origin, its longest side to 1. `unit_sphere`: the same centre to the
    origin, its farthest vertex to distance 1. `none`: nothing moves.
    """
    if mode == "none":
        return Normalization((0.0, 0.0, 0.0), 1.0)
    bounds = assembly_bounds(types, assembly)
    centre = bounds.mean(axis=0)
    if mode == "unit_box":
        size = float((bounds[1] - bounds[0]).max())
    else:
        size = max(
            float(np.linalg.norm(transform_points(pose, types[index].vertices) - centre, axis=1).max())
            for index, pose in zip(assembly.types, assembly.poses, strict=True)
        )
    x, y, z = centre.tolist()
    return Normalization((x, y, z), 1.0 / size)
