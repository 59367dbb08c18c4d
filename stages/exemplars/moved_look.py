"""The look of a part, laid on the surface of its type."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from stages.model_files.scene import Surface
from stages.shape.appearance import Look
from stages.shape.arrays import FloatArray, IntArray
from stages.shape.geometry.pose import transform_points
from stages.shape.kit import PartMesh, PartType

NEAREST_FACES = 4
"""Faces of the part among which that of a face of the type is looked for."""
CORNER_ORDERS = np.array([[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]])


def look_on(kind: PartType, part: Surface, transforms: FloatArray, tolerance: float) -> tuple[FloatArray, Look] | None:
    """Return the first transform (4, 4) that lays a type face by face on a part, and the part's look on the type.

    transforms: rigid, from the coordinates of the type to those of the part, float64 (k, 4, 4)
    tolerance: largest distance of equal corners, as a share of the diagonal

    A part of one colour or material without textures needs no equal faces. Returns None for other parts without them.
    """
    for transform in transforms:
        moved = transform_points(transform, kind.vertices)[kind.faces]
        places = _equal_faces(moved, part.vertices[part.faces], tolerance * kind.diagonal)
        if places is not None:
            faces, corners = places
            appearance = part.appearance and part.appearance.select(faces, corners).turned(transform[:3, :3].T)
            return transform, _with_normals_of(kind, Look(part.face_colors[faces], appearance))
    if _is_uniform(part):
        # any face of it will do
        faces = np.zeros(len(kind.faces), dtype=np.int64)
        appearance = part.appearance and replace(part.appearance.select(faces), uv=None, normals=None)
        return transforms[0], _with_normals_of(kind, Look(part.face_colors[faces], appearance))
    return None


def _equal_faces(corners: FloatArray, others: FloatArray, near: float) -> tuple[IntArray, IntArray] | None:
    """Return the equal face of each face (f, 3, 3) among others, int64 (f,), and the corner of it at each corner,
    int64 (f, 3); None if a face has none.
    """
    from scipy.spatial import cKDTree

    if len(corners) != len(others):
        return None
    nearest = min(NEAREST_FACES, len(others))
    candidates = cKDTree(others.mean(axis=1)).query(corners.mean(axis=1), nearest)[1].reshape(-1, nearest)
    # faces, candidates, orders
    gaps = np.linalg.norm(others[candidates][:, :, CORNER_ORDERS] - corners[:, None, None], axis=-1).max(axis=-1)
    best = gaps.reshape(len(corners), -1).argmin(axis=1)
    rows = np.arange(len(corners))
    if (gaps.reshape(len(corners), -1)[rows, best] > near).any():
        return None
    return candidates[rows, best // len(CORNER_ORDERS)], CORNER_ORDERS[best % len(CORNER_ORDERS)]


def _is_uniform(part: Surface) -> bool:
    """Return whether all faces of a part look alike wherever they are seen."""
    if (part.face_colors != part.face_colors[0]).any():
        return False
    look = part.appearance
    if look is None:
        return True
    (first, *others) = np.unique(look.face_material).tolist()
    return not others and (first < 0 or not look.materials[first].textures)


def _with_normals_of(kind: PartMesh, look: Look) -> Look:
    """Return a look with the normals of the type itself, where both have some."""
    own = kind.appearance.normals if kind.appearance is not None else None
    if look.appearance is None or own is None:
        return look
    return replace(look, appearance=replace(look.appearance, normals=own))
