"""Random choices in compiled code."""

from __future__ import annotations

import numba
import numpy as np

from stages.shape.kernel_options import CALLED_BY_KERNELS


@numba.njit(cache=True, **CALLED_BY_KERNELS)
def random_below(rng, n):
    """Draw an int64 from 0 to n - 1."""
    return min(np.int64(rng.random() * n), n - 1)
