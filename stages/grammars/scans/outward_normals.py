"""On which side of its planar patches a scanned surface is outside."""

from __future__ import annotations

import numpy as np

from stages.grammars.scans.point_neighbourhoods import patch_contacts
from stages.shape.arrays import FloatArray, IntArray

ALIKE = 0.7
"""Cosine of the angle of two patches from which on what meets at them is no crease."""


def outward_signs(
    points: FloatArray, near: IntArray, of: IntArray, middles: FloatArray, normals: FloatArray, given: FloatArray | None
) -> FloatArray:
    """1 or -1 for each patch, by which its normal is outward, float64 (m,)."""
    held = of >= 0
    if given is not None:
        along = (given[held] * normals[of[held]]).sum(axis=1)
        return np.where(np.bincount(of[held], along, len(normals)) < 0, -1.0, 1.0)
    component, signs = _agreeing(points, near, of, middles, normals)
    apart = points[held] - points[held].mean(axis=0)
    away = np.bincount(of[held], (apart * (normals * signs[:, None])[of[held]]).sum(axis=1), len(normals))
    found: FloatArray = signs * np.where(np.bincount(component, away)[component] < 0, -1.0, 1.0)
    return found


def _agreeing(
    points: FloatArray, near: IntArray, of: IntArray, middles: FloatArray, normals: FloatArray
) -> tuple[IntArray, FloatArray]:
    """The component of each patch among those that meet, int32 (m,), and signs by which their normals agree, float64
    (m,): at a crease both look away from each other's patch, or both to it."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import breadth_first_order, connected_components, minimum_spanning_tree

    one, other = patch_contacts(near, of)
    flip = of[one] > of[other]
    one, other = np.where(flip, other, one), np.where(flip, one, other)
    pairs, place, count = np.unique(
        np.column_stack([of[one], of[other]]), axis=0, return_inverse=True, return_counts=True
    )
    first, second = pairs.T
    cosine = (normals[first] * normals[second]).sum(axis=1)
    # each patch lies on one side of the other's plane beside the crease, wherever it goes from there
    off = ((points[one] - middles[of[other]]) * normals[of[other]]).sum(axis=1)
    off_other = ((points[other] - middles[of[one]]) * normals[of[one]]).sum(axis=1)
    across = [np.bincount(place.reshape(-1), each, len(pairs)) for each in (off, off_other)]
    agree = np.where(np.abs(cosine) > ALIKE, cosine, across[0] * across[1]) > 0
    total = len(normals)
    tree = minimum_spanning_tree(coo_array((1.0 / count, (first, second)), shape=(total, total)))
    both = (tree + tree.T).tocsr()
    sense = coo_array((np.where(agree, 1.0, -1.0), (first, second)), shape=(total, total))
    sense = (sense + sense.T).tocsr()
    number, component = connected_components(both, directed=False)
    signs = np.ones(total)
    for each in range(number):
        root = int(np.flatnonzero(component == each)[0])
        order, before = breadth_first_order(both, root, directed=False)
        for patch in order[1:].tolist():
            signs[patch] = signs[before[patch]] * sense[before[patch], patch]
    return component, signs
