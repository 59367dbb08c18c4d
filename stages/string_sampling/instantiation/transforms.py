"""Rigid transforms in kernels."""

from __future__ import annotations

import numba


@numba.njit(cache=True)
def compose(rotation, translation, then_rotation, then_translation, out_rotation, out_translation):
    """Write the product of two transforms to the last two arguments."""
    for i in range(3):
        out_translation[i] = translation[i]
        for k in range(3):
            out_translation[i] += rotation[i, k] * then_translation[k]
        for j in range(3):
            x = 0.0
            for k in range(3):
                x += rotation[i, k] * then_rotation[k, j]
            out_rotation[i, j] = x


@numba.njit(cache=True)
def relative_transform(rotation, translation, other_rotation, other_translation, out_rotation, out_translation):
    """Write a second pose in coordinates of a first to the last two arguments."""
    for i in range(3):
        out_translation[i] = 0.0
        for k in range(3):
            out_translation[i] += rotation[k, i] * (other_translation[k] - translation[k])
        for j in range(3):
            x = 0.0
            for k in range(3):
                x += rotation[k, i] * other_rotation[k, j]
            out_rotation[i, j] = x
