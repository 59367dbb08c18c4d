"""Sorting for compiled code; numba's own `sort` and `argsort` take four times as long to compile, at each place."""

from __future__ import annotations

import numba
import numpy as np

_RUN_LENGTH = 8
"""Elements of the runs that insertion sorts before runs are merged."""


@numba.njit(cache=True)
def sort_order(keys):
    """Return the indices that sort keys (n,) ascending, int64 (n,); equal keys keep their order. No key is NaN."""
    count = len(keys)
    order, merged = np.arange(count), np.empty(count, dtype=np.int64)
    for begin in range(0, count, _RUN_LENGTH):
        for i in range(begin + 1, min(begin + _RUN_LENGTH, count)):
            index, place = order[i], i
            while place > begin and keys[order[place - 1]] > keys[index]:
                order[place] = order[place - 1]
                place -= 1
            order[place] = index
    width = _RUN_LENGTH
    while width < count:
        for begin in range(0, count, 2 * width):
            left, middle = begin, min(begin + width, count)
            right, end = middle, min(begin + 2 * width, count)
            for place in range(begin, end):
                if left < middle and (right == end or keys[order[left]] <= keys[order[right]]):
                    merged[place] = order[left]
                    left += 1
                else:
                    merged[place] = order[right]
                    right += 1
        order, merged = merged, order
        width *= 2
    return order


@numba.njit(cache=True)
def sort_values(values):
    """Sort values (n,) ascending in place, by Shell sort with Knuth's gaps. No value is NaN."""
    gap = 1
    while 9 * gap < len(values):
        gap = 3 * gap + 1
    while gap > 0:
        for i in range(gap, len(values)):
            value, place = values[i], i
            while place >= gap and values[place - gap] > value:
                values[place] = values[place - gap]
                place -= gap
            values[place] = value
        gap //= 3
