"""Joints by which parts of a shape move, such as hinges of doors and slides of drawers."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from stages.shape.arrays import FloatArray


@dataclass(frozen=True)
class PartJoint:
    """How parts move against the rest of their shape. Parts with equal joints move together.

    kind: revolute turns about the axis, counter-clockwise seen against it; prismatic slides along it
    axis: unit vector, in the coordinates of the shape
    origin: a point of the axis, in the coordinates of the shape
    upper: largest angle in radians, or largest travel in the unit of the shape; the shape shows position 0
    """

    kind: Literal["revolute", "prismatic"]
    axis: tuple[float, float, float]
    origin: tuple[float, float, float]
    upper: float

    def transformed(self, matrix: FloatArray) -> PartJoint:
        """Return the joint moved by a rigid matrix (4, 4)."""
        axis = (matrix[:3, :3] @ self.axis).tolist()
        origin = (matrix[:3, :3] @ self.origin + matrix[:3, 3]).tolist()
        return replace(self, axis=tuple(axis), origin=tuple(origin))
