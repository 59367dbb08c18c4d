"""Random choices in compiled code."""

from __future__ import annotations

import numba
import numpy as np


@numba.njit(cache=True)
def random_below(rng, n):
    """Draw an int64 from 0 to n - 1."""
    return min(np.int64(rng.random() * n), n - 1)
