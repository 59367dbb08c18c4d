"""The outward sides of the planar patches of a scanned surface."""

from __future__ import annotations

import numpy as np

from stages.grammars.scans.point_neighbourhoods import patch_contacts
from stages.shape.arrays import FloatArray, IntArray

FLAT_COSINE = 0.7
"""Patches that meet at an angle of a larger cosine make no crease."""


def outward_signs(
    points: FloatArray,
    near: IntArray,
    patch_of: IntArray,
    middles: FloatArray,
    normals: FloatArray,
    given: FloatArray | None,
) -> FloatArray:
    """Return the sign, 1 or -1, that makes the normal of each patch outward, float64 (m,).

    points: float64 (n, 3)
    near: int32 (n, k), their neighbours
    patch_of: int32 (n,), the patch of each point, -1 for none
    middles, normals: float64 (m, 3), planes of the patches
    given: float64 (n, 3), outward normals of the points; None if unknown
    """
    held = patch_of >= 0
    if given is not None:
        along = (given[held] * normals[patch_of[held]]).sum(axis=1)
        return np.where(np.bincount(patch_of[held], along, len(normals)) < 0, -1.0, 1.0)
    component, signs = _consistent_signs(points, near, patch_of, middles, normals)
    offsets = points[held] - points[held].mean(axis=0)
    away = np.bincount(patch_of[held], (offsets * (normals * signs[:, None])[patch_of[held]]).sum(axis=1), len(normals))
    outward: FloatArray = signs * np.where(np.bincount(component, away)[component] < 0, -1.0, 1.0)
    return outward


def _consistent_signs(
    points: FloatArray, near: IntArray, patch_of: IntArray, middles: FloatArray, normals: FloatArray
) -> tuple[IntArray, FloatArray]:
    """Return the component of each patch among patches that meet, int32 (m,), and consistent signs, float64 (m,).

    At a crease, the normals of both patches point away from the other patch, or both point to it.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import breadth_first_order, connected_components, minimum_spanning_tree

    one, other = patch_contacts(near, patch_of)
    flip = patch_of[one] > patch_of[other]
    one, other = np.where(flip, other, one), np.where(flip, one, other)
    pairs, pair, count = np.unique(
        np.column_stack([patch_of[one], patch_of[other]]), axis=0, return_inverse=True, return_counts=True
    )
    first, second = pairs.T
    cosine = (normals[first] * normals[second]).sum(axis=1)
    # near the crease, each patch lies on one side of the other's plane, wherever it goes from there
    off = ((points[one] - middles[patch_of[other]]) * normals[patch_of[other]]).sum(axis=1)
    off_other = ((points[other] - middles[patch_of[one]]) * normals[patch_of[one]]).sum(axis=1)
    across = [np.bincount(pair.reshape(-1), distance, len(pairs)) for distance in (off, off_other)]
    agree = np.where(np.abs(cosine) > FLAT_COSINE, cosine, across[0] * across[1]) > 0
    total = len(normals)
    tree = minimum_spanning_tree(coo_array((1.0 / count, (first, second)), shape=(total, total)))
    both = (tree + tree.T).tocsr()
    sense = coo_array((np.where(agree, 1.0, -1.0), (first, second)), shape=(total, total))
    sense = (sense + sense.T).tocsr()
    number, component = connected_components(both, directed=False)
    signs = np.ones(total)
    for label in range(number):
        root = int(np.flatnonzero(component == label)[0])
        order, before = breadth_first_order(both, root, directed=False)
        for patch in order[1:].tolist():
            signs[patch] = signs[before[patch]] * sense[before[patch], patch]
    return component, signs
