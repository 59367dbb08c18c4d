"""Parts that are not congruent, but alike: how many are compared, and whether two have like sizes or shapes."""

from __future__ import annotations

import numpy as np

from stages.shape.arrays import FloatArray

MAX_PARTS_COMPARED = 1000
"""Parts among which graded rows and scattered parts are looked for; all pairs of them are compared."""
MAX_SIZE_RATIO = 1.5
"""Largest ratio of the sizes of two like parts, along each of their principal axes."""
MAX_SHAPE_DISTANCE = 0.5
"""Largest distance of vertices of two parts of like shapes, once both have size 1 along their principal axes."""
MIN_ALIKE_SHARE = 0.9
"""Share of the vertices to which that applies."""
MIN_THICKNESS_SHARE = 0.1
"""Sizes below this share of a part's largest count as this share: thin leaves are alike."""


def principal_axes(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the sizes of points (n, 3) along their principal axes, float64 (3,) ascending, and the axes as columns."""
    values, axes = np.linalg.eigh(np.cov(points.T))
    return np.sqrt(np.maximum(values, 0.0)), axes


def have_like_sizes(first: FloatArray, second: FloatArray) -> bool:
    """Return whether two parts have like sizes, float64 (3,) ascending each, along their principal axes."""
    one, other = (np.maximum(size, MIN_THICKNESS_SHARE * size[-1]) for size in (first, second))
    return bool((np.maximum(one / other, other / one) <= MAX_SIZE_RATIO).all())


def have_like_shapes(first: FloatArray, second: FloatArray) -> bool:
    """Return whether the vertices (n, 3) of two parts nearly coincide once one is turned and both have one size.

    Tried are the four turns that lay principal axes on principal axes. Mirror images do not count.
    """
    from scipy.spatial import cKDTree

    one, other = (_in_principal_axes(points) for points in (first, second))
    tree = cKDTree(one)
    for turn in ((1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)):
        turned = other * np.array(turn)
        gaps = tree.query(turned)[0], cKDTree(turned).query(one)[0]
        if min((distances <= MAX_SHAPE_DISTANCE).mean() for distances in gaps) >= MIN_ALIKE_SHARE:
            return True
    return False


def _in_principal_axes(points: FloatArray) -> FloatArray:
    """Return points (n, 3) in right-handed principal axes, their middle at 0, with size 1 along each that has any."""
    sizes, axes = principal_axes(points)
    axes[:, 0] *= np.sign(np.linalg.det(axes))
    scaled: FloatArray = (points - points.mean(axis=0)) @ axes / np.maximum(sizes, MIN_THICKNESS_SHARE * sizes[-1])
    return scaled
