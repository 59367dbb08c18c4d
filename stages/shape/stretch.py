"""Stretched parts: meshes that a linear map made longer or shorter (substructures §5.2, §5.3).

An assembly stores the stretch of a part next to its pose, which stays rigid. A shape has a mesh of its own for each
stretched part, so its readers need not know. A record stores both in one matrix, the part's placement.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.geometry.pose import rounded
from stages.shape.kit import Assembly, PartMesh

RIGID_TOLERANCE = 1e-6
"""Largest deviation of a rotation from orthogonality."""
STRETCH_DECIMALS = 9
STRETCHED_DEPTH = 0.02
"""Extra depth that a stretched part may reach into another, as a share of the smaller part's diagonal."""


@dataclass(frozen=True, eq=False)
class StretchedMesh(PartMesh):
    """The surface of a stretched part.

    of: unstretched mesh
    stretch: symmetric, float64 (3, 3)
    """

    of: PartMesh
    stretch: FloatArray

    @property
    def label(self) -> str:
        return self.of.label


def split(placed: FloatArray) -> tuple[FloatArray, FloatArray | None]:
    """Split affine placements (n, 4, 4) by polar decomposition into rigid poses (n, 4, 4) and stretches (n, 3, 3), or
    None if all are rigid.
    """
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
    """Return the assembly with each part moved by an affine map of its own (n, 4, 4)."""
    poses, stretches = split(motions @ assembly.placements)
    return replace(assembly, poses=poses, stretches=stretches)


def bake(meshes: Sequence[PartMesh], assembly: Assembly) -> tuple[tuple[PartMesh, ...], Assembly]:
    """Return meshes and an unstretched assembly of them that look like `assembly` of `meshes`.

    The meshes are the used ones, then one for each stretched type. Without stretches both are returned unchanged.
    """
    if assembly.stretches is None:
        return tuple(meshes), assembly
    bent = np.abs(assembly.stretches - np.eye(3)).max(axis=(1, 2)) > RIGID_TOLERANCE
    baked = [meshes[kind] for kind in np.unique(assembly.types[~bent]).tolist()]
    index_of = {(kind, b""): index for index, kind in enumerate(np.unique(assembly.types[~bent]).tolist())}
    types = []
    for part_type, stretch, is_bent in zip(assembly.types.tolist(), assembly.stretches, bent, strict=True):
        key = part_type, stretch.tobytes() if is_bent else b""
        if key not in index_of:
            index_of[key] = len(baked)
            baked.append(_stretched(meshes[part_type], stretch))
        types.append(index_of[key])
    return tuple(baked), replace(assembly, types=np.array(types, dtype=np.int16), stretches=None)


def placements(meshes: Sequence[PartMesh], assembly: Assembly) -> FloatArray:
    """Return the transform of each unstretched mesh into the world, float64 (n, 4, 4), as records store it."""
    if not any(isinstance(mesh, StretchedMesh) for mesh in meshes):
        return assembly.poses
    stretches = [mesh.stretch if isinstance(mesh, StretchedMesh) else np.eye(3) for mesh in meshes]
    return rounded(replace(assembly, stretches=np.stack(stretches)[assembly.types]).placements)


def _stretched(mesh: PartMesh, stretch: FloatArray) -> StretchedMesh:
    look = None if mesh.appearance is None else mesh.appearance.turned(stretch)
    vertices = mesh.vertices @ stretch
    return StretchedMesh(mesh.name, vertices, mesh.faces, mesh.face_colors, mesh, stretch, appearance=look)
