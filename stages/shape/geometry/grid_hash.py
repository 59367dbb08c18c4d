"""Cells of a hash grid over points, compiled."""

from __future__ import annotations

import numba
import numpy as np

OWN_CELL = 13
"""The number of the neighbouring cell that is the cell of the point itself."""
_PRIMES = (73856093, 19349663, 83492791)


@numba.njit(cache=True)
def cell_hash(point, turn, side):
    """Return the hash of a cell of width `side` at or next to a point, by its first three coordinates.

    turn: 0 to 26, from the cell before the point's in every direction to the one behind; OWN_CELL is the point's own
    """
    x, y, z = np.int64(point[0] // side), np.int64(point[1] // side), np.int64(point[2] // side)
    x, y, z = x + turn // 9 - 1, y + turn // 3 % 3 - 1, z + turn % 3 - 1
    return x * _PRIMES[0] ^ y * _PRIMES[1] ^ z * _PRIMES[2]
