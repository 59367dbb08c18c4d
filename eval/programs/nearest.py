"""The nearest of many clouds by Chamfer distance, and of many programs by their words."""

from __future__ import annotations

from collections.abc import Sequence

import numba
import numpy as np

from stages.shapeassembly.analysis.structure import token_distance, tokens
from stages.shapeassembly.syntax.program import AssemblyProgram

CELLS = 24
"""Cells along each axis of the grid that bounds of distances are looked up in."""


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
        total += np.sqrt(_least(squares, second.shape[1]))
        if total > limit * first.shape[1]:
            break
    return total / first.shape[1]


@numba.njit(cache=True)
def _least(numbers, many):
    """The least of the first `many` numbers, which are spoilt."""
    while many > 1:  # the less of two halves, one by one
        half = (many + 1) // 2
        for j in range(many - half):
            numbers[j] = numbers[j] if numbers[j] < numbers[j + half] else numbers[j + half]
        many = half
    return numbers[0]


@numba.njit(cache=True)
def nearest_and_which(clouds, others, itself):
    """For each cloud (n, k, 3) the Chamfer distance, the mean of both ways, to the nearest of the others (m, k, 3),
    float64 (n,), and which that is, int64 (n,); `itself`: both are the same clouds, and none is its own neighbour.
    Coordinates count to the precision of float32.

    Exact: what is nearest by a bound comes first, and the rest is not looked at once bounds are no less than what was
    found.
    """
    ours, theirs = _by_axes(clouds), _by_axes(others)
    squares = np.empty(max(clouds.shape[1], others.shape[1]), np.float32)
    found = np.full(len(clouds), np.inf)
    which = np.full(len(clouds), -1)
    grid = _grid(ours, theirs)
    our_cells, our_ways = _cells(ours, grid)
    their_cells, their_ways = _cells(theirs, grid)
    field, bounds = np.empty(CELLS**3, np.uint16), np.empty((len(clouds), len(others)))
    for m in range(len(others)):
        _field(theirs[m], grid, squares, field)
        for n in range(len(clouds)):
            bounds[n, m] = _at_least(field, our_cells[n], our_ways[n], grid)
    for n in range(len(clouds)):
        _field(ours[n], grid, squares, field)
        for m in range(len(others)):
            bounds[n, m] += _at_least(field, their_cells[m], their_ways[m], grid)
        if itself:
            bounds[n, n] = np.inf
        for m in np.argsort(bounds[n]):
            if bounds[n, m] >= 2 * found[n]:
                break
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
def _grid(ours, theirs):
    """A grid of CELLS cells along each axis around all clouds, (3, 2): where it begins, and how wide a cell is."""
    grid = np.empty((3, 2))
    for axis in range(3):
        grid[axis, 0] = min(ours[:, axis].min(), theirs[:, axis].min())
        end = max(ours[:, axis].max(), theirs[:, axis].max())
        grid[axis, 1] = max(end - grid[axis, 0], 1e-6) * (1 + 1e-6) / CELLS
    return grid


@numba.njit(cache=True)
def _cells(clouds, grid):
    """The cell of each point of the clouds, int32 (n, k), and the mean way from the points of each to the centres of
    these, float64 (n,)."""
    cells = np.empty((clouds.shape[0], clouds.shape[2]), np.int32)
    ways = np.zeros(len(clouds))
    for n in range(clouds.shape[0]):
        for i in range(clouds.shape[2]):
            cell, square = 0, 0.0
            for axis in range(3):
                at = (clouds[n, axis, i] - grid[axis, 0]) / grid[axis, 1]
                place = min(int(at), CELLS - 1)
                cell = CELLS * cell + place
                square += ((at - place - 0.5) * grid[axis, 1]) ** 2
            cells[n, i] = cell
            ways[n] += np.sqrt(square) / clouds.shape[2]
    return cells, ways


@numba.njit(cache=True)
def _field(cloud, grid, squares, field):
    """How far the nearest point of a cloud (3, k) is from the centre of each cell, at least: in whole units of `_unit`,
    little more than one too few."""
    unit = _unit(grid)
    for cell in range(CELLS**3):
        x = np.float32(grid[0, 0] + (cell // CELLS**2 + 0.5) * grid[0, 1])
        y = np.float32(grid[1, 0] + (cell // CELLS % CELLS + 0.5) * grid[1, 1])
        z = np.float32(grid[2, 0] + (cell % CELLS + 0.5) * grid[2, 1])
        for j in range(cloud.shape[1]):
            squares[j] = (x - cloud[0, j]) ** 2 + (y - cloud[1, j]) ** 2 + (z - cloud[2, j]) ** 2
        field[cell] = np.uint16(max(np.sqrt(_least(squares, cloud.shape[1])) / unit - 0.1, 0.0))


@numba.njit(cache=True)
def _unit(grid):
    """A 65,000th of the diagonal of the grid."""
    return CELLS * np.sqrt((grid[:, 1] ** 2).sum()) / 65000


@numba.njit(cache=True)
def _at_least(field, cells, way, grid):
    """What the mean distance of the points in these cells to the nearest of a cloud is at least: from the centre of a
    cell it is no longer than by way of the point."""
    total = 0
    for cell in cells:
        total += field[cell]
    return total * _unit(grid) / len(cells) - way


@numba.njit(cache=True)
def nearest(clouds, others, itself):
    """The distances alone of `nearest_and_which`."""
    return nearest_and_which(clouds, others, itself)[0]


@numba.njit(cache=True)
def paired(clouds, others):
    """The Chamfer distance of each cloud (n, k, 3) to the other (n, k, 3) at its place, float64 (n,)."""
    ours, theirs = _by_axes(clouds), _by_axes(others)
    squares, found = np.empty(max(clouds.shape[1], others.shape[1]), np.float32), np.empty(len(clouds))
    for n in range(len(clouds)):
        there = _one_way(ours[n], theirs[n], squares, np.inf)
        found[n] = (there + _one_way(theirs[n], ours[n], squares, np.inf)) / 2
    return found


def nearest_programs(programs: Sequence[AssemblyProgram], others: Sequence[AssemblyProgram]) -> list[tuple[int, int]]:
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
