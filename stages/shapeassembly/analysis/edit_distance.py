"""The compiled edit distance of two sequences."""

from __future__ import annotations

import numba
import numpy as np


@numba.njit(cache=True)
def edit_distance(a, b):
    """Return the minimum number of insertions, deletions and changes from int64 (n,) to int64 (m,) (Levenshtein)."""
    row = np.arange(len(b) + 1)
    for i in range(len(a)):
        diagonal = row[0]
        row[0] = i + 1
        for j in range(len(b)):
            kept = diagonal + (a[i] != b[j])
            diagonal = row[j + 1]
            row[j + 1] = min(kept, diagonal + 1, row[j] + 1)
    return row[-1]
