"""A part of a shape: a mesh with a label and a colour, which its copies keep."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np

from stages.programs.curves.mesh import QuadMesh
from stages.shape.arrays import FloatArray
from stages.shape.kit import PartMesh
from stages.shape.part_joint import PartJoint


@dataclass(frozen=True, eq=False)
class Part:
    """A labelled mesh of one colour.

    label: such as "leg"
    color: sRGB, 0 to 255
    joint: how it moves against the rest of the shape; None if it stays. Give it to parts in their final place
    """

    label: str
    mesh: QuadMesh
    color: tuple[int, int, int]
    joint: PartJoint | None = None

    def transformed(self, matrix: FloatArray) -> Part:
        """The part moved by an affine matrix (4, 4), without a joint."""
        return replace(self, mesh=self.mesh.transformed(matrix), joint=None)

    def deformed(self, function: Callable[[FloatArray], FloatArray]) -> Part:
        """The part deformed by `function`, as `QuadMesh.deformed`, without a joint."""
        return replace(self, mesh=self.mesh.deformed(function), joint=None)

    def on(self, joint: PartJoint) -> Part:
        """The part as one that moves by `joint`."""
        return replace(self, joint=joint)

    def part_mesh(self) -> PartMesh:
        """The part as triangles of one colour, named by its label."""
        faces = self.mesh.triangles
        colors = np.empty((len(faces), 3), dtype=np.uint8)
        colors[:] = self.color
        return PartMesh(self.label, self.mesh.vertices, faces, colors)


def joined(parts: Iterable[Part], label: str | None = None) -> Part:
    """One part of several, with the colour of the first, and with its label by default."""
    listed = list(parts)
    mesh = QuadMesh.joined(part.mesh for part in listed)
    return Part(listed[0].label if label is None else label, mesh, listed[0].color)
