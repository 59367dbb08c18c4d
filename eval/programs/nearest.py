"""The nearest of many point clouds by Chamfer distance, in compiled code."""

from __future__ import annotations

import numba
import numpy as np

GRID_CELLS_PER_AXIS = 24
"""Of the grid that holds lower bounds of distances."""


@numba.njit(cache=True)
def _one_way(first, second, squares, limit):
    """Return the mean distance of the points (3, k) of a cloud to the nearest of another, or any value over `limit`.

    squares: scratch, one number for each point of the other cloud. Loops without conditions run vectorized.
    """
    total = 0.0
    for i in range(first.shape[1]):
        for j in range(second.shape[1]):
            x, y, z = first[0, i] - second[0, j], first[1, i] - second[1, j], first[2, i] - second[2, j]
            squares[j] = x * x + y * y + z * z
        total += np.sqrt(_minimum(squares, second.shape[1]))
        if total > limit * first.shape[1]:
            break
    return total / first.shape[1]


@numba.njit(cache=True)
def _minimum(numbers, count):
    """Return the least of the first `count` numbers; overwrites them."""
    while count > 1:  # the lesser of two halves, element by element
        half = (count + 1) // 2
        for j in range(count - half):
            numbers[j] = numbers[j] if numbers[j] < numbers[j + half] else numbers[j + half]
        count = half
    return numbers[0]


@numba.njit(cache=True)
def nearest_clouds(clouds, others, itself):
    """Return, for each cloud (n, k, 3), the Chamfer distance to the nearest of others (m, k, 3), and its index.

    Distances, float64 (n,), are means of both directions, in float32 precision; indices are int64 (n,). With `itself`
    both arguments are the same clouds, and no cloud is its own neighbour. The result is exact: candidates come in the
    order of lower bounds until a bound exceeds the least distance.
    """
    ours, theirs = _by_axes(clouds), _by_axes(others)
    squares = np.empty(max(clouds.shape[1], others.shape[1]), np.float32)
    distances = np.full(len(clouds), np.inf)
    indices = np.full(len(clouds), -1)
    grid = _grid(ours, theirs)
    our_cells, our_offsets = _cells(ours, grid)
    their_cells, their_offsets = _cells(theirs, grid)
    field, bounds = np.empty(GRID_CELLS_PER_AXIS**3, np.uint16), np.empty((len(clouds), len(others)))
    for m in range(len(others)):
        _field(theirs[m], grid, squares, field)
        for n in range(len(clouds)):
            bounds[n, m] = _lower_bound(field, our_cells[n], our_offsets[n], grid)
    for n in range(len(clouds)):
        _field(ours[n], grid, squares, field)
        for m in range(len(others)):
            bounds[n, m] += _lower_bound(field, their_cells[m], their_offsets[m], grid)
        if itself:
            bounds[n, n] = np.inf
        for m in np.argsort(bounds[n]):
            if bounds[n, m] >= 2 * distances[n]:
                break
            there = _one_way(ours[n], theirs[m], squares, 2 * distances[n])
            if there < 2 * distances[n]:
                back = _one_way(theirs[m], ours[n], squares, 2 * distances[n] - there)
                if there + back < 2 * distances[n]:
                    distances[n], indices[n] = (there + back) / 2, m
    return distances, indices


@numba.njit(cache=True)
def _by_axes(clouds):
    """Return the clouds (n, k, 3) as float32 (n, 3, k)."""
    return clouds.transpose(0, 2, 1).astype(np.float32).copy()


@numba.njit(cache=True)
def _grid(ours, theirs):
    """Return the start and the cell width of a grid around all clouds, by axis, (3, 2)."""
    grid = np.empty((3, 2))
    for axis in range(3):
        grid[axis, 0] = min(ours[:, axis].min(), theirs[:, axis].min())
        end = max(ours[:, axis].max(), theirs[:, axis].max())
        grid[axis, 1] = max(end - grid[axis, 0], 1e-6) * (1 + 1e-6) / GRID_CELLS_PER_AXIS
    return grid


@numba.njit(cache=True)
def _cells(clouds, grid):
    """Return the cell of each point, int32 (n, k), and each cloud's mean distance of points to cell centres (n,)."""
    cells = np.empty((clouds.shape[0], clouds.shape[2]), np.int32)
    offsets = np.zeros(len(clouds))
    for n in range(clouds.shape[0]):
        for i in range(clouds.shape[2]):
            cell, square = 0, 0.0
            for axis in range(3):
                at = (clouds[n, axis, i] - grid[axis, 0]) / grid[axis, 1]
                index = min(int(at), GRID_CELLS_PER_AXIS - 1)
                cell = GRID_CELLS_PER_AXIS * cell + index
                square += ((at - index - 0.5) * grid[axis, 1]) ** 2
            cells[n, i] = cell
            offsets[n] += np.sqrt(square) / clouds.shape[2]
    return cells, offsets


@numba.njit(cache=True)
def _field(cloud, grid, squares, field):
    """Fill `field` with lower bounds of the distance of each cell centre to a cloud (3, k), in units of `_unit`."""
    unit = _unit(grid)
    for cell in range(GRID_CELLS_PER_AXIS**3):
        x = np.float32(grid[0, 0] + (cell // GRID_CELLS_PER_AXIS**2 + 0.5) * grid[0, 1])
        y = np.float32(grid[1, 0] + (cell // GRID_CELLS_PER_AXIS % GRID_CELLS_PER_AXIS + 0.5) * grid[1, 1])
        z = np.float32(grid[2, 0] + (cell % GRID_CELLS_PER_AXIS + 0.5) * grid[2, 1])
        for j in range(cloud.shape[1]):
            squares[j] = (x - cloud[0, j]) ** 2 + (y - cloud[1, j]) ** 2 + (z - cloud[2, j]) ** 2
        field[cell] = np.uint16(max(np.sqrt(_minimum(squares, cloud.shape[1])) / unit - 0.1, 0.0))


@numba.njit(cache=True)
def _unit(grid):
    """Return a 65,000th of the diagonal of the grid."""
    return GRID_CELLS_PER_AXIS * np.sqrt((grid[:, 1] ** 2).sum()) / 65000


@numba.njit(cache=True)
def _lower_bound(field, cells, offset, grid):
    """Return a lower bound of the mean distance of points in these cells to a cloud, by the triangle inequality."""
    total = 0
    for cell in cells:
        total += field[cell]
    return total * _unit(grid) / len(cells) - offset


@numba.njit(cache=True)
def nearest_distances(clouds, others, itself):
    """Return the distances of `nearest_clouds`."""
    return nearest_clouds(clouds, others, itself)[0]


@numba.njit(cache=True)
def paired_distances(clouds, others):
    """Return the Chamfer distance of each cloud (n, k, 3) to the other cloud at its index, float64 (n,)."""
    ours, theirs = _by_axes(clouds), _by_axes(others)
    squares, distances = np.empty(max(clouds.shape[1], others.shape[1]), np.float32), np.empty(len(clouds))
    for n in range(len(clouds)):
        there = _one_way(ours[n], theirs[n], squares, np.inf)
        distances[n] = (there + _one_way(theirs[n], ours[n], squares, np.inf)) / 2
    return distances
