"""Points and rotations in compiled code: transforming them, and whether two rotations of a part look the same."""

from __future__ import annotations

import numba
import numpy as np


@numba.njit(cache=True)
def same_rotation(symmetries, first, last, rotation, other, slack):
    """Return the symmetry under which two rotations of a part look the same, or -1. slack: tolerance of all entries
    together
    """
    limit = slack * slack
    between = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            x = 0.0
            for k in range(3):
                x += other[k, i] * rotation[k, j]
            between[i, j] = x
    for index in range(first, last):
        gap = 0.0
        for i in range(3):
            for j in range(3):
                d = between[i, j] - symmetries[index, i, j]
                gap += d * d
        if gap <= limit:
            return index
    return -1


@numba.njit(cache=True)
def looks_same(kit, part_type, rotation, other):
    """Return the symmetry under which two rotations of a type look the same within the pose tolerance, or -1."""
    first, last = kit.symmetry_starts[part_type], kit.symmetry_starts[part_type + 1]
    return same_rotation(kit.symmetries, first, last, rotation, other, kit.limits[0] / kit.reach[part_type])


@numba.njit(cache=True)
def part_at(translations, by_type, first, last, point, tolerance):
    """Return which of the parts by_type[first:last] is at a point, or -1."""
    limit = tolerance * tolerance
    for k in range(first, last):
        part = by_type[k]
        if squared_distance(translations[part], point) <= limit:
            return part
    return -1


@numba.njit(cache=True)
def squared_distance(p, q):
    """Return the squared distance of two points."""
    x, y, z = p[0] - q[0], p[1] - q[1], p[2] - q[2]
    return x * x + y * y + z * z


@numba.njit(cache=True)
def apply_transform(transform, point, out):
    """Write a transformed point to `out`. transform: float64 (4, 3), rows of a rotation, then a translation"""
    for i in range(3):
        out[i] = transform[i, 0] * point[0] + transform[i, 1] * point[1] + transform[i, 2] * point[2] + transform[3, i]


@numba.njit(cache=True)
def rotate(transform, rotation, out):
    """Write the rotation of `transform` applied to a rotation to `out`."""
    for i in range(3):
        for j in range(3):
            out[i, j] = (
                transform[i, 0] * rotation[0, j] + transform[i, 1] * rotation[1, j] + transform[i, 2] * rotation[2, j]
            )


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
