"""Edit distance of two sequences, compiled."""

from __future__ import annotations

import numba
import numpy as np


@numba.njit(cache=True)
def edit_distance(a, b):
    """Fewest insertions, deletions and changes of one item that make int64 (n,) into int64 (m,) (Levenshtein)."""
    row = np.arange(len(b) + 1)
    for i in range(len(a)):
        diagonal = row[0]
        row[0] = i + 1
        for j in range(len(b)):
            kept = diagonal + (a[i] != b[j])
            diagonal = row[j + 1]
            row[j + 1] = min(kept, diagonal + 1, row[j] + 1)
    return row[-1]
