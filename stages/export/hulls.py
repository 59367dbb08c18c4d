"""Convex collision pieces: the convex hull of a part."""

from __future__ import annotations

import numpy as np

from stages.shape.arrays import ByteArray, FloatArray
from stages.shape.kit import PartMesh

FLAT_SHARE = 1e-4
"""A part thinner than this share of its length has no hull that simulators accept; its hull gets this thickness."""
HULL_GREY = 128


def convex_piece(mesh: PartMesh) -> PartMesh:
    """Return the convex hull of a part as a closed mesh in the part's coordinates."""
    from trimesh.convex import convex_hull

    hull = convex_hull(_with_thickness(mesh.vertices))
    faces = np.asarray(hull.faces, dtype=np.int32)
    grey: ByteArray = np.full((len(faces), 3), HULL_GREY, dtype=np.uint8)
    return PartMesh(mesh.name, np.asarray(hull.vertices, dtype=np.float64), faces, grey)


def _with_thickness(vertices: FloatArray) -> FloatArray:
    """Return points whose hull has a volume: those of a flat or straight part, doubled across its thin directions."""
    axes = np.linalg.svd(vertices - vertices.mean(axis=0), full_matrices=False)[2]
    along = vertices @ axes.T
    extents = np.ptp(along, axis=0)
    needed = FLAT_SHARE * extents.max()
    for axis, extent in zip(axes, extents.tolist(), strict=True):
        if extent < needed:
            vertices = np.concatenate([vertices + axis * needed / 2, vertices - axis * needed / 2])
    return vertices
