"""The nearest of many clouds by Chamfer distance, and of many programs by their words."""

from __future__ import annotations

from collections.abc import Sequence

import numba
import numpy as np

from stages.shapeassembly.program import Program
from stages.shapeassembly.structure import token_distance, tokens

__all__ = ["nearest", "nearest_and_which", "nearest_programs"]


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
def nearest_and_which(clouds, others, itself):
    """For each cloud (n, k, 3) the Chamfer distance, the mean of both ways, to the nearest of the others (m, k, 3),
    float64 (n,), and which that is, int64 (n,); `itself`: both are the same clouds, and none is its own neighbour."""
    found = np.full(len(clouds), np.inf)
    which = np.full(len(clouds), -1)
    for n in range(len(clouds)):
        for m in range(len(others)):
            if itself and n == m:
                continue
            there = _one_way(clouds[n], others[m], 2 * found[n])
            if there < 2 * found[n]:
                back = _one_way(others[m], clouds[n], 2 * found[n] - there)
                if there + back < 2 * found[n]:
                    found[n], which[n] = (there + back) / 2, m
    return found, which


@numba.njit(cache=True)
def nearest(clouds, others, itself):
    """The distances alone of `nearest_and_which`."""
    return nearest_and_which(clouds, others, itself)[0]


def nearest_programs(programs: Sequence[Program], others: Sequence[Program]) -> list[tuple[int, int]]:
    """For each program the distance (`program_distance`) to the nearest of the others, the first of several, and which
    that is."""
    known = [tokens(each) for each in others]
    found = []
    for words in map(tokens, programs):
        # Every word more or less is an edit: those of like length come first, and most others need no look.
        best, which = len(words) + max(map(len, known)), -1
        for place in sorted(range(len(known)), key=lambda place: abs(len(known[place]) - len(words))):
            if abs(len(known[place]) - len(words)) >= best:
                break
            distance = token_distance(words, known[place])
            if distance < best:
                best, which = distance, place
        found.append((best, which))
    return found
