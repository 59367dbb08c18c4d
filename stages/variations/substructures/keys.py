"""Arrays that grow, and sets of keys, in kernels."""

from __future__ import annotations

import numba
import numpy as np


@numba.njit(cache=True)
def grown(array, needed):
    """The array, or one of at least `needed` rows that begins like it."""
    if needed <= len(array):
        return array
    larger = np.empty((max(2 * len(array), needed), array.shape[1]), dtype=array.dtype)
    larger[: len(array)] = array
    return larger


@numba.njit(cache=True)
def holds(table, key):
    """Whether an open-addressing table uint64 (2^k,) holds a key, which is not 0."""
    slot = key & np.uint64(len(table) - 1)
    while table[slot] != 0:
        if table[slot] == key:
            return True
        slot = (slot + np.uint64(1)) & np.uint64(len(table) - 1)
    return False


@numba.njit(cache=True)
def with_key(table, filled, key):
    """A table of `filled` keys with one more, which it does not hold; a larger one where it was half full."""
    if 2 * (filled + 1) > len(table):
        larger = np.zeros(4 * len(table), dtype=np.uint64)
        for each in table:
            if each != 0:
                _put(larger, each)
        table = larger
    _put(table, key)
    return table


@numba.njit(cache=True)
def _put(table, key):
    slot = key & np.uint64(len(table) - 1)
    while table[slot] != 0:
        slot = (slot + np.uint64(1)) & np.uint64(len(table) - 1)
    table[slot] = key
