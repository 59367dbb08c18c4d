"""Arrays that grow by doubling, in compiled code."""

from __future__ import annotations

import numba
import numpy as np

from stages.shape.kernel_options import CALLED_BY_KERNELS


@numba.njit(cache=True, **CALLED_BY_KERNELS)
def grown(array, needed):
    """Return an array of at least `needed` rows that begins with the rows of `array`, which may be itself."""
    if needed <= len(array):
        return array
    larger = np.empty((max(2 * len(array), needed), array.shape[1]), dtype=array.dtype)
    larger[: len(array)] = array
    return larger
