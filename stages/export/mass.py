"""Mass, centre and inertia of parts, from exact integrals over their meshes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.kit import PartMesh
from stages.shape.physics.solids import MeshSolids
from stages.shape.shape import Shape


@dataclass(frozen=True)
class PartMasses:
    """Mass properties of placed parts.

    masses: in kilograms, float64 (n,)
    centres: centres of mass, float64 (n, 3)
    moments: second moments of mass about each centre, the integral of x xᵀ dm, float64 (n, 3, 3)
    """

    masses: FloatArray
    centres: FloatArray
    moments: FloatArray

    def combined(self, parts: Sequence[int]) -> tuple[float, FloatArray, FloatArray]:
        """Return mass, centre (3,) and tensor of inertia about the centre (3, 3) of some parts as one body."""
        own = list(parts)
        masses, centres = self.masses[own], self.centres[own]
        centre = masses @ centres / masses.sum()
        offsets = centres - centre
        moment = self.moments[own].sum(axis=0) + np.einsum("n,ni,nj->ij", masses, offsets, offsets)
        return float(masses.sum()), centre, np.trace(moment) * np.eye(3) - moment


def part_masses(shape: Shape, density: float, shell_thickness: float) -> PartMasses:
    """Return the mass properties of all parts of a shape in metres.

    Like the verdicts of the record, it weighs closed parts by volume, and all parts by area if one of them is open.
    Where parts overlap, both count.

    density: in kilograms a cubic metre
    shell_thickness: thickness of the walls where parts weigh by area, in metres
    """
    types, poses = shape.assembly.types, shape.assembly.poses
    used = sorted(set(types.tolist()))
    solids = MeshSolids([shape.meshes[index] for index in used])
    row_of = {index: row for row, index in enumerate(used)}
    closed = bool(solids.closed.all())
    measures = solids.volumes * density if closed else solids.areas * shell_thickness * density
    moments = np.stack(
        [
            _box_moment(solids, row) if closed and solids.boxes[row] else _moment(shape.meshes[index], closed)
            for row, index in enumerate(used)
        ]
    )
    moments *= measures[:, None, None]
    if not closed:
        moments += measures[:, None, None] * shell_thickness**2 / 12 * np.eye(3)
    rows = [row_of[index] for index in types.tolist()]
    rotations = poses[:, :3, :3]
    middles = solids.centroids if closed else np.stack([shape.meshes[index].centroid for index in used])
    centres = np.einsum("nij,nj->ni", rotations, middles[rows]) + poses[:, :3, 3]
    return PartMasses(measures[rows], centres, rotations @ moments[rows] @ rotations.transpose(0, 2, 1))


def _box_moment(solids: MeshSolids, row: int) -> FloatArray:
    """Return the second moment of a box of unit mass about its centre, float64 (3, 3)."""
    axes = solids.axes[row]
    moment: FloatArray = axes.T @ np.diag(solids.halves[row] ** 2 / 3) @ axes
    return moment


def _moment(mesh: PartMesh, closed: bool) -> FloatArray:
    """Return the second moment of the volume, or of the surface, of unit mass about its centroid, float64 (3, 3).

    The integral of x xᵀ over a simplex with n corners is its measure times (Σ v vᵀ + s sᵀ) / (n (n + 1)), where s is
    the sum of its corners v. A volume is the sum of the tetrahedra of the origin and each face.
    """
    origin = mesh.vertices.mean(axis=0)
    corners = mesh.vertices[mesh.faces] - origin
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    if closed:
        measures, corner_count = np.einsum("fi,fi->f", corners[:, 0], across) / 6, 4
    else:
        measures, corner_count = np.linalg.norm(across, axis=1) / 2, 3
    shares = measures / measures.sum()
    sums = corners.sum(axis=1)
    squares = np.einsum("fki,fkj->fij", corners, corners) + np.einsum("fi,fj->fij", sums, sums)
    centre = shares @ sums / corner_count
    moment: FloatArray = np.einsum("f,fij->ij", shares, squares) / (corner_count * (corner_count + 1))
    return moment - np.outer(centre, centre)
