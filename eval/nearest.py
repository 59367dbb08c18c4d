"""The nearest of many clouds by Chamfer distance, and of many programs by their words."""

from __future__ import annotations

from collections.abc import Sequence

import numba
import numpy as np

from stages.shapeassembly.program import Program
from stages.shapeassembly.structure import token_distance, tokens

__all__ = ["nearest", "nearest_and_which", "nearest_programs"]


@numba.njit(cache=True)
def _one_way(first, second, squares, limit):
    """Mean distance of the points (3, k) of one cloud to the nearest of another, or a part of it that is over `limit`.

    squares: room for as many numbers as the other has points. In loops without a condition, as they are here, a
    processor takes eight points at once.
    """
    total = 0.0
    for i in range(first.shape[1]):
        for j in range(second.shape[1]):
            x, y, z = first[0, i] - second[0, j], first[1, i] - second[1, j], first[2, i] - second[2, j]
            squares[j] = x * x + y * y + z * z
        many = second.shape[1]
        while many > 1:  # the least of two halves, point by point, until one is left
            half = (many + 1) // 2
            for j in range(many - half):
                squares[j] = squares[j] if squares[j] < squares[j + half] else squares[j + half]
            many = half
        total += np.sqrt(squares[0])
        if total > limit * first.shape[1]:
            break
    return total / first.shape[1]


@numba.njit(cache=True)
def nearest_and_which(clouds, others, itself):
    """For each cloud (n, k, 3) the Chamfer distance, the mean of both ways, to the nearest of the others (m, k, 3),
    float64 (n,), and which that is, int64 (n,); `itself`: both are the same clouds, and none is its own neighbour.
    Coordinates count to the precision of float32."""
    ours, theirs = _by_axes(clouds), _by_axes(others)
    squares = np.empty(max(clouds.shape[1], others.shape[1]), np.float32)
    found = np.full(len(clouds), np.inf)
    which = np.full(len(clouds), -1)
    for n in range(len(clouds)):
        for m in range(len(others)):
            if itself and n == m:
                continue
            there = _one_way(ours[n], theirs[m], squares, 2 * found[n])
            if there < 2 * found[n]:
                back = _one_way(theirs[m], ours[n], squares, 2 * found[n] - there)
                if there + back < 2 * found[n]:
                    found[n], which[n] = (there + back) / 2, m
    return found, which


@numba.njit(cache=True)
def _by_axes(clouds):
    """The clouds (n, k, 3) as float32 (n, 3, k)."""
    return clouds.transpose(0, 2, 1).astype(np.float32).copy()


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
