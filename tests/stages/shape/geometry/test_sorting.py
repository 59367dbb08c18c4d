"""Sorting for compiled code, compared with numpy's."""

from __future__ import annotations

import numpy as np
import pytest

from stages.shape.geometry.sorting import sort_order, sort_values


@pytest.mark.parametrize("count", [0, 1, 2, 7, 8, 9, 16, 17, 100, 1023])
@pytest.mark.parametrize("dtype", [np.float64, np.int64])
def test_values_are_in_order_and_equal_keys_as_they_came(count: int, dtype: type) -> None:
    for distinct in (1, 3, 10_000):
        values = np.random.default_rng([count, distinct]).integers(-distinct, distinct, count).astype(dtype)
        np.testing.assert_array_equal(sort_order(values), np.argsort(values, kind="stable"))
        ranked = values.copy()
        sort_values(ranked)
        np.testing.assert_array_equal(ranked, np.sort(values))


def test_infinite_keys_stand_at_the_ends() -> None:
    values = np.array([1.0, np.inf, -2.0, -np.inf, 0.0])
    assert sort_order(values).tolist() == [3, 2, 4, 0, 1]
