"""Cells of a grid that holds points by their hash, compiled."""

from __future__ import annotations

import numba
import numpy as np

OWN_CELL = 13
"""The turn of `cell_hash` that is the cell of the point itself."""
_PRIMES = (73856093, 19349663, 83492791)


@numba.njit(cache=True)
def cell_hash(point, turn, side):
    """The hash of a cell of width `side` around a point, of which the first three numbers count: turn 0 to 26 are the
    cell before it in every direction to the one behind, OWN its own."""
    x, y, z = np.int64(point[0] // side), np.int64(point[1] // side), np.int64(point[2] // side)
    x, y, z = x + turn // 9 - 1, y + turn // 3 % 3 - 1, z + turn % 3 - 1
    return x * _PRIMES[0] ^ y * _PRIMES[1] ^ z * _PRIMES[2]
