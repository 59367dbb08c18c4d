"""Cells of a cubic lattice: where points lie, and packed keys by which occupied cells are found."""

from __future__ import annotations

import numba
import numpy as np

from stages.shape.arrays import BoolArray

BITS = 21
"""Bits of a key that say where a cell lies along an axis."""


def pack(cells: np.ndarray) -> np.ndarray:
    """Cells int64 (n, 3), none negative, as one number each, int64 (n,), in lexicographic order."""
    packed: np.ndarray = (cells[:, 0] << 2 * BITS) | (cells[:, 1] << BITS) | cells[:, 2]
    return packed


def unpack(keys: np.ndarray) -> np.ndarray:
    """The cells int64 (n, 3) of packed keys int64 (n,)."""
    lowest = (1 << BITS) - 1
    return np.column_stack([keys >> 2 * BITS, keys >> BITS & lowest, keys & lowest])


def cell_keys(cells: np.ndarray) -> np.ndarray:
    """Packed keys of cells int64 (n, 3) anywhere; -1 for those below the lattice's lowest."""
    keys = np.full(len(cells), -1, dtype=np.int64)
    above: BoolArray = cells.min(axis=1, initial=0) >= 0
    keys[above] = pack(cells[above])
    return keys


@numba.njit(cache=True)
def cell_of(point, origin, size, cell):
    """The lattice cell of a point, into `cell` int64 (3,)."""
    for axis in range(3):
        cell[axis] = int(np.floor((point[axis] - origin[axis]) / size))


@numba.njit(cache=True)
def cell_index(keys, i, j, k):
    """The place of a cell among `keys`, -1 where it is empty."""
    if min(i, j, k) < 0:
        return -1
    key = (i << 2 * BITS) | (j << BITS) | k
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
    """The places of the 26 neighbours of each of `cells` among `keys`, int32 (n, 26); -1 where one is empty."""
    found = np.empty((len(cells), 26), dtype=np.int32)
    for n in range(len(cells)):
        place = 0
        for x in range(-1, 2):
            for y in range(-1, 2):
                for z in range(-1, 2):
                    if x != 0 or y != 0 or z != 0:
                        found[n, place] = cell_index(keys, cells[n, 0] + x, cells[n, 1] + y, cells[n, 2] + z)
                        place += 1
    return found


@numba.njit(cache=True)
def doubled(array):
    """An array twice as long that begins with this one."""
    larger = np.empty((2 * len(array), *array.shape[1:]), dtype=array.dtype)
    larger[: len(array)] = array
    return larger
