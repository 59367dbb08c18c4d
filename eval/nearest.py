"""The nearest of many clouds by Chamfer distance, compiled."""

from __future__ import annotations

import numba
import numpy as np

__all__ = ["nearest"]


@numba.njit(cache=True)
def _one_way(first, second, limit):
    """Mean distance of the points of one cloud to the nearest of another, or a part of it that is over `limit`."""
    total = 0.0
    for i in range(len(first)):
        best = np.inf
        for j in range(len(second)):
            x, y, z = first[i, 0] - second[j, 0], first[i, 1] - second[j, 1], first[i, 2] - second[j, 2]
            best = min(best, x * x + y * y + z * z)
        total += best**0.5
        if total > limit * len(first):
            break
    return total / len(first)


@numba.njit(cache=True)
def nearest(clouds, others, itself):
    """For each cloud (n, k, 3) the Chamfer distance, the mean of both ways, to the nearest of the others (m, k, 3),
    float64 (n,); `itself`: both are the same clouds, and none is its own neighbour."""
    found = np.full(len(clouds), np.inf)
    for n in range(len(clouds)):
        for m in range(len(others)):
            if itself and n == m:
                continue
            there = _one_way(clouds[n], others[m], 2 * found[n])
            if there < 2 * found[n]:
                back = _one_way(others[m], clouds[n], 2 * found[n] - there)
                found[n] = min(found[n], (there + back) / 2)
    return found
