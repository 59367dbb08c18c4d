"""Stretched parts: meshes that a linear map made longer or shorter than their kit has them (substructures §5.2, §5.3).

An assembly carries the stretch of a part beside its pose, which stays rigid; a shape has a mesh of its own for each
part that is stretched, so whoever reads shapes need not know. A record says both in one matrix, the part's placement.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.geometry.pose import rounded
from stages.shape.kit import Assembly, PartMesh

RIGID_TOLERANCE = 1e-6
"""A linear map whose singular values are as near to 1 is a rotation."""
STRETCH_DECIMALS = 9
"""So many of a stretch are kept."""
STRETCHED_DEPTH = 0.02
"""A stretched part may reach so far into another, as a share of the smaller one's diagonal, beyond what their types do
in the exemplars."""


@dataclass(frozen=True, eq=False)
class StretchedMesh(PartMesh):
    """The surface of a part that was stretched. of: the mesh as it is; stretch: float64 (3, 3), symmetric."""

    of: PartMesh
    stretch: FloatArray

    @property
    def label(self) -> str:
        return self.of.label


def split(placed: FloatArray) -> tuple[FloatArray, FloatArray | None]:
    """Rigid poses (n, 4, 4) and stretches (n, 3, 3) of affine placements (n, 4, 4), by polar decomposition; None in
    place of the stretches where all placements are rigid."""
    linear = placed[:, :3, :3]
    gaps = np.abs(np.swapaxes(linear, 1, 2) @ linear - np.eye(3)).max(axis=(1, 2), initial=0.0)
    bent = np.flatnonzero(gaps > RIGID_TOLERANCE)
    if not len(bent):
        return placed, None
    u, sizes, vt = np.linalg.svd(linear[bent])
    poses, stretches = placed.copy(), np.tile(np.eye(3), (len(placed), 1, 1))
    poses[bent, :3, :3] = u @ vt
    # On a grid, so that a record is split into the same again: parts that are stretched alike share a mesh.
    stretches[bent] = np.round(np.swapaxes(vt, 1, 2) @ (sizes[:, :, None] * vt), STRETCH_DECIMALS) + 0.0
    return poses, stretches


def moved_by(assembly: Assembly, motions: FloatArray) -> Assembly:
    """The assembly with each part moved by an affine map of its own (n, 4, 4)."""
    poses, stretches = split(motions @ assembly.placements)
    return replace(assembly, poses=poses, stretches=stretches)


def bake(meshes: Sequence[PartMesh], assembly: Assembly) -> tuple[tuple[PartMesh, ...], Assembly]:
    """Meshes and an assembly of them that look like `assembly` of `meshes` and are not stretched: of meshes that are in
    use, and behind them one for each type and stretch. As they came where nothing is stretched."""
    if assembly.stretches is None:
        return tuple(meshes), assembly
    bent = np.abs(assembly.stretches - np.eye(3)).max(axis=(1, 2)) > RIGID_TOLERANCE
    made = [meshes[kind] for kind in np.unique(assembly.types[~bent]).tolist()]
    places = {(kind, b""): place for place, kind in enumerate(np.unique(assembly.types[~bent]).tolist())}
    types = []
    for part_type, stretch, is_bent in zip(assembly.types.tolist(), assembly.stretches, bent, strict=True):
        key = part_type, stretch.tobytes() if is_bent else b""
        if key not in places:
            places[key] = len(made)
            made.append(_stretched(meshes[part_type], stretch))
        types.append(places[key])
    return tuple(made), replace(assembly, types=np.array(types, dtype=np.int16), stretches=None)


def placements(meshes: Sequence[PartMesh], assembly: Assembly) -> FloatArray:
    """What moves each mesh as its kit has it, float64 (n, 4, 4), as a record has it; the poses themselves where nothing
    was stretched."""
    if not any(isinstance(mesh, StretchedMesh) for mesh in meshes):
        return assembly.poses
    found = [mesh.stretch if isinstance(mesh, StretchedMesh) else np.eye(3) for mesh in meshes]
    return rounded(replace(assembly, stretches=np.stack(found)[assembly.types]).placements)


def _stretched(mesh: PartMesh, stretch: FloatArray) -> StretchedMesh:
    return StretchedMesh(mesh.name, mesh.vertices @ stretch, mesh.faces, mesh.face_colors, mesh, stretch)
