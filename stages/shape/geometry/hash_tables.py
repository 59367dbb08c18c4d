"""Hash tables for compiled code: open addressing with 64-bit keys, 0 for a free slot; and cells of a hash grid."""

from __future__ import annotations

import numba
import numpy as np

MISSING_KEY = -9
"""What `look_up` returns for a key that the table does not hold."""

OWN_CELL = 13
"""The number of the neighbouring cell that is the cell of the point itself."""
_PRIMES = (73856093, 19349663, 83492791)


@numba.njit(cache=True, inline="always")
def mix(x):
    """Return the bits of a uint64 well mixed (the finalizer of splitmix64)."""
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return x ^ (x >> np.uint64(31))


@numba.njit(cache=True)
def look_up(keys, values, key):
    """Return the value of a key in a table of keys uint64 (2^k,) and values (2^k,), or MISSING_KEY."""
    mask = np.uint64(len(keys) - 1)
    slot = key & mask
    while keys[slot] != np.uint64(0):
        if keys[slot] == key:
            return values[slot]
        slot = (slot + np.uint64(1)) & mask
    return MISSING_KEY


@numba.njit(cache=True)
def contains(table, key):
    """Return whether a set uint64 (2^k,) holds a key."""
    slot = key & np.uint64(len(table) - 1)
    while table[slot] != 0:
        if table[slot] == key:
            return True
        slot = (slot + np.uint64(1)) & np.uint64(len(table) - 1)
    return False


@numba.njit(cache=True)
def with_key(table, count, key):
    """Return a set of `count` keys with one more, which it does not hold; a larger array where it was half full."""
    if 2 * (count + 1) > len(table):
        larger = np.zeros(4 * len(table), dtype=np.uint64)
        for old_key in table:
            if old_key != 0:
                _put(larger, old_key)
        table = larger
    _put(table, key)
    return table


@numba.njit(cache=True)
def _put(table, key):
    slot = key & np.uint64(len(table) - 1)
    while table[slot] != 0:
        slot = (slot + np.uint64(1)) & np.uint64(len(table) - 1)
    table[slot] = key


@numba.njit(cache=True)
def cell_hash(point, turn, side):
    """Return the hash of a cell of width `side` at or next to a point, by its first three coordinates.

    turn: 0 to 26, from the cell before the point's in every direction to the one behind; OWN_CELL is the point's own
    """
    x, y, z = np.int64(point[0] // side), np.int64(point[1] // side), np.int64(point[2] // side)
    x, y, z = x + turn // 9 - 1, y + turn // 3 % 3 - 1, z + turn % 3 - 1
    return x * _PRIMES[0] ^ y * _PRIMES[1] ^ z * _PRIMES[2]
