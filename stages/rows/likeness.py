"""Whether two parts that are not congruent have like sizes."""

from __future__ import annotations

import numpy as np

from stages.shape.arrays import FloatArray

MAX_SIZE_RATIO = 1.5
"""Largest ratio of the sizes of two like parts, along each of their principal axes."""
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
