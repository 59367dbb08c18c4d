"""Cells of a cubic lattice: where points lie, and packed keys by which occupied cells are found."""

from __future__ import annotations

import numba
import numpy as np

from stages.shape.arrays import BoolArray

BITS_PER_AXIS = 21
"""Bits of a packed key for the position along one axis."""


def pack(cells: np.ndarray) -> np.ndarray:
    """Pack non-negative cells int64 (n, 3) into one number each, int64 (n,), in lexicographic order."""
    packed: np.ndarray = (cells[:, 0] << 2 * BITS_PER_AXIS) | (cells[:, 1] << BITS_PER_AXIS) | cells[:, 2]
    return packed


def unpack(keys: np.ndarray) -> np.ndarray:
    """Return the cells int64 (n, 3) of packed keys int64 (n,)."""
    lowest = (1 << BITS_PER_AXIS) - 1
    return np.column_stack([keys >> 2 * BITS_PER_AXIS, keys >> BITS_PER_AXIS & lowest, keys & lowest])


def cell_keys(cells: np.ndarray) -> np.ndarray:
    """Return packed keys of any cells int64 (n, 3); -1 for cells with a negative index."""
    keys = np.full(len(cells), -1, dtype=np.int64)
    valid: BoolArray = cells.min(axis=1, initial=0) >= 0
    keys[valid] = pack(cells[valid])
    return keys


@numba.njit(cache=True)
def cell_of(point, origin, size, cell):
    """Write the lattice cell of a point into `cell` int64 (3,)."""
    for axis in range(3):
        cell[axis] = int(np.floor((point[axis] - origin[axis]) / size))


@numba.njit(cache=True)
def cell_index(keys, i, j, k):
    """Return the index of cell (i, j, k) among ascending `keys`, or -1 if the cell is empty."""
    if min(i, j, k) < 0:
        return -1
    key = (i << 2 * BITS_PER_AXIS) | (j << BITS_PER_AXIS) | k
    low, high = 0, len(keys)
    while low < high:
        middle = (low + high) // 2
        if keys[middle] < key:
            low = middle + 1
        else:
            high = middle
    return low if low < len(keys) and keys[low] == key else -1


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
