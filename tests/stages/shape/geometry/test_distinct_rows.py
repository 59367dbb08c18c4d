"""Distinct rows are those of NumPy."""

from __future__ import annotations

import numpy as np
import pytest

from stages.shape.geometry.distinct_rows import distinct_rows


@pytest.mark.parametrize("shape", [(0, 3), (1, 2), (50, 1), (200, 3), (40, 7)])
@pytest.mark.parametrize("dtype", [np.float64, np.int64])
def test_rows_are_those_of_numpy(shape: tuple[int, int], dtype: type) -> None:
    rows = np.random.default_rng(0).integers(-2, 3, shape).astype(dtype)
    if dtype is np.float64:
        rows[rows == 0] *= -1.0  # both zeros are equal
    _, first, numbers = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    found = distinct_rows(rows)
    np.testing.assert_array_equal(found.first, first)
    np.testing.assert_array_equal(found.numbers, numbers.reshape(-1))
