"""Cells of a cubic lattice: where points lie, and packed keys by which occupied cells are found."""

from __future__ import annotations

import numba
import numpy as np

BITS_PER_AXIS = 21
"""Bits of a packed key for the position along one axis."""


def pack_cells(cells: np.ndarray) -> np.ndarray:
    """Pack non-negative cells int64 (n, 3) into one number each, int64 (n,), in lexicographic order."""
    packed: np.ndarray = (cells[:, 0] << 2 * BITS_PER_AXIS) | (cells[:, 1] << BITS_PER_AXIS) | cells[:, 2]
    return packed


def unpack_cells(keys: np.ndarray) -> np.ndarray:
    """Return the cells int64 (n, 3) of packed keys int64 (n,)."""
    lowest = (1 << BITS_PER_AXIS) - 1
    return np.column_stack([keys >> 2 * BITS_PER_AXIS, keys >> BITS_PER_AXIS & lowest, keys & lowest])


def cell_keys(cells: np.ndarray) -> np.ndarray:
    """Return packed keys of any cells int64 (n, 3); -1 for cells with a negative index."""
    negative = (cells[:, 0] | cells[:, 1] | cells[:, 2]) < 0  # the sign is the highest bit
    keys = pack_cells(cells)
    keys[negative] = -1
    return keys


@numba.njit(cache=True)
def cell_of(point, origin, size, cell):
    """Write the lattice cell of a point into `cell` int64 (3,)."""
    for axis in range(3):
        cell[axis] = int(np.floor((point[axis] - origin[axis]) / size))


@numba.njit(cache=True)
def cells_around(point, reach, origin, size, low, high):
    """Write the lowest and highest lattice cells within `reach` of a point, along each axis, into `low` and `high`."""
    for axis in range(3):
        low[axis] = int(np.floor((point[axis] - reach - origin[axis]) / size))
        high[axis] = int(np.floor((point[axis] + reach - origin[axis]) / size))


@numba.njit(cache=True)
def cell_index(keys, i, j, k):
    """Return the index of cell (i, j, k) among ascending `keys`, or -1 if the cell is empty."""
    place = first_not_below(keys, cell_key(i, j, k), 0, len(keys))
    return place if place < len(keys) and keys[place] == cell_key(i, j, k) else -1


@numba.njit(cache=True)
def cell_key(i, j, k):
    """Return the packed key of cell (i, j, k); -1 for a cell with a negative index."""
    return -1 if min(i, j, k) < 0 else (i << 2 * BITS_PER_AXIS) | (j << BITS_PER_AXIS) | k


@numba.njit(cache=True)
def first_not_below(keys, key, low, high):
    """Return the first index from `low` to `high` at which ascending `keys` are at least `key`; `high` for none."""
    while low < high:
        middle = (low + high) // 2
        if keys[middle] < key:
            low = middle + 1
        else:
            high = middle
    return low


@numba.njit(cache=True)
def first_not_below_near(keys, key, near):
    """Return the first index at which ascending `keys` are at least `key`, len(keys) for none; fast close to `near`."""
    low, high, step = near, near, 1
    if near < len(keys) and keys[near] < key:
        while high < len(keys) and keys[high] < key:
            low, high, step = high + 1, high + step, 2 * step
        high = min(high, len(keys))
    else:
        while low > 0 and keys[low - 1] >= key:
            low, high, step = low - step, low - 1, 2 * step
        low = max(low, 0)
    return first_not_below(keys, key, low, high)


@numba.njit(cache=True)
def neighbours_of(cells, keys):
    """Return the indices among `keys` of the 26 neighbours of each cell, int32 (n, 26); -1 for empty neighbours."""
    neighbours = np.empty((len(cells), 26), dtype=np.int32)
    for n in range(len(cells)):
        column = 0
        for x in range(-1, 2):
            for y in range(-1, 2):
                for z in range(-1, 2):
                    if x != 0 or y != 0 or z != 0:
                        neighbours[n, column] = cell_index(keys, cells[n, 0] + x, cells[n, 1] + y, cells[n, 2] + z)
                        column += 1
    return neighbours


@numba.njit(cache=True)
def doubled(array):
    """Return an array of twice the length that begins with the given one."""
    larger = np.empty((2 * len(array), *array.shape[1:]), dtype=array.dtype)
    larger[: len(array)] = array
    return larger
