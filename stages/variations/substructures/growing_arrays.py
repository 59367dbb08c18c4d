"""Arrays that grow by doubling, in compiled code."""

from __future__ import annotations

import numba
import numpy as np


@numba.njit(cache=True)
def grown(array, needed):
    """Return an array of at least `needed` rows that begins with the rows of `array`, which may be itself."""
    if needed <= len(array):
        return array
    larger = np.empty((max(2 * len(array), needed), array.shape[1]), dtype=array.dtype)
    larger[: len(array)] = array
    return larger
