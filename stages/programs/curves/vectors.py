"""Dot products, cross products and unit vectors by rows; `np.cross` and `np.linalg.norm` cost more than a sweep."""

from __future__ import annotations

import numpy as np

from stages.shape.arrays import FloatArray


def dots(a: FloatArray, b: FloatArray) -> FloatArray:
    """Dot product of each row of `a` (n, 3) with the same row of `b` (n, 3), float64 (n,)."""
    product: FloatArray = np.einsum("ij,ij->i", a, b)
    return product


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Cross product of each row of `a` (n, 3) with the same row of `b` (n, 3), float64 (n, 3)."""
    product = np.empty_like(a)
    product[:, 0] = a[:, 1] * b[:, 2] - a[:, 2] * b[:, 1]
    product[:, 1] = a[:, 2] * b[:, 0] - a[:, 0] * b[:, 2]
    product[:, 2] = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    return product


def unit(rows: FloatArray) -> FloatArray:
    """Each row (n, 3) scaled to length 1; no row may be zero."""
    scaled: FloatArray = rows / np.sqrt(dots(rows, rows))[:, None]
    return scaled
