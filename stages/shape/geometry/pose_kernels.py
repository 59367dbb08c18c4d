"""Points and rotations in kernels: move them, and test whether two look the same."""

from __future__ import annotations

import numba
import numpy as np


@numba.njit(cache=True)
def same_rotation(symmetries, first, last, rotation, other, slack):
    """Return the symmetry by which two rotations of a part look the same, entries within `slack` together, or -1."""
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
    """Return the symmetry by which two rotations of a part of a type look the same within the pose tolerance, or -1."""
    first, last = kit.symmetry_starts[part_type], kit.symmetry_starts[part_type + 1]
    return same_rotation(kit.symmetries, first, last, rotation, other, kit.limits[0] / kit.reach[part_type])


@numba.njit(cache=True)
def part_at(translations, by_type, first, last, point, tolerance):
    """Return which of the parts `by_type[first:last]` is at a point, or -1."""
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
def transform(motion, point, out):
    """Write a point moved by a rigid transform into `out`."""
    for i in range(3):
        out[i] = motion[i, 0] * point[0] + motion[i, 1] * point[1] + motion[i, 2] * point[2] + motion[3, i]


@numba.njit(cache=True)
def rotate(motion, rotation, out):
    """Write the product of a rotation and that of a rigid transform into `out`."""
    for i in range(3):
        for j in range(3):
            out[i, j] = motion[i, 0] * rotation[0, j] + motion[i, 1] * rotation[1, j] + motion[i, 2] * rotation[2, j]
