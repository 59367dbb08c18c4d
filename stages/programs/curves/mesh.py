"""A mesh of quads, the result of every building block (geocode §3.1)."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from stages.programs.curves.vectors import cross, dots
from stages.shape.arrays import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class QuadMesh:
    """Vertices and faces of four corners.

    vertices: float64 (v, 3)
    quads: int32 (q, 4), counter-clockwise seen from outside; a triangle repeats its last index: (a, b, c, c)

    Meshes of the building blocks are closed, oriented outwards and two-manifold; `mesh_defects` checks it.
    """

    vertices: FloatArray
    quads: IntArray

    @cached_property
    def triangles(self) -> IntArray:
        """The faces as triangles, int32 (f, 3); each quad is cut along the diagonal with the larger smaller piece."""
        from stages.programs.curves.kernels import cut_quads

        triangles: IntArray = cut_quads(self.vertices, self.quads)
        return triangles

    @cached_property
    def bounds(self) -> FloatArray:
        """Lowest and highest corner of the bounding box, float64 (2, 3)."""
        return np.stack([self.vertices.min(axis=0), self.vertices.max(axis=0)])

    @cached_property
    def triangle_bounds(self) -> FloatArray:
        """Lowest and highest corners of the bounding boxes of the triangles, float64 (2, f, 3)."""
        a, b, c = (self.vertices[self.triangles[:, k]] for k in range(3))
        return np.stack([np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)])

    @property
    def volume(self) -> float:
        """Enclosed volume; negative where a closed mesh is inside out."""
        a, b, c = (self.vertices[self.triangles[:, k]] for k in range(3))
        return float(dots(a, cross(b, c)).sum()) / 6.0

    def relative(self, points: FloatArray) -> FloatArray:
        """Relative coordinates of points (n, 3) in the bounding box, 0 to 1; 0 along a side without length."""
        low, high = self.bounds
        share: FloatArray = (points - low) / np.where(high > low, high - low, 1.0)
        return share

    def transformed(self, matrix: FloatArray) -> QuadMesh:
        """The mesh moved by an affine matrix (4, 4); a reflection reverses the faces.

        Raises ValueError for a matrix that flattens the mesh.
        """
        linear = matrix[:3, :3]
        volume = linear[0] @ np.array(
            [
                linear[1, 1] * linear[2, 2] - linear[1, 2] * linear[2, 1],
                linear[1, 2] * linear[2, 0] - linear[1, 0] * linear[2, 2],
                linear[1, 0] * linear[2, 1] - linear[1, 1] * linear[2, 0],
            ]
        )
        if not abs(volume) > 1e-15:
            raise ValueError("the matrix flattens the mesh: every scale must differ from 0")
        return QuadMesh(
            self.vertices @ linear.T + matrix[:3, 3], self.quads if volume > 0.0 else reversed_faces(self.quads)
        )

    def deformed(self, function: Callable[[FloatArray], FloatArray]) -> QuadMesh:
        """The mesh with its vertices (v, 3) moved by `function` to new positions (v, 3).

        `mesh.deformed(lambda v: v + [0, 0.1, 0] * np.sin(v[:, :1]))`; `mesh.relative` gives relative positions.
        A reflection by the function leaves the mesh inside out: use `transformed`. Raises ValueError for another shape
        and for values that are not finite.
        """
        moved = np.asarray(function(self.vertices.copy()), dtype=np.float64)
        if moved.shape != self.vertices.shape or not np.isfinite(moved).all():
            raise ValueError(f"a deformation returns finite vertices {self.vertices.shape}, not {moved.shape}")
        return QuadMesh(moved, self.quads)

    @staticmethod
    def joined(meshes: Iterable[QuadMesh]) -> QuadMesh:
        """One mesh of several, which remain separate surfaces. Raises ValueError for an empty sequence."""
        listed = list(meshes)
        if not listed:
            raise ValueError("there is no mesh to join")
        first = np.cumsum([0, *(len(mesh.vertices) for mesh in listed[:-1])])
        quads = [mesh.quads + np.int32(start) for mesh, start in zip(listed, first.tolist(), strict=True)]
        return QuadMesh(np.concatenate([mesh.vertices for mesh in listed]), np.concatenate(quads))


def reversed_faces(quads: IntArray) -> IntArray:
    """The faces with opposite orientation, int32 (q, 4); a triangle still repeats its last index."""
    four = (quads[:, 2] != quads[:, 3])[:, None]
    return np.where(four, quads[:, ::-1], quads[:, [1, 0, 2, 2]]).astype(np.int32)
