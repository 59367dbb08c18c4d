"""What replaces functions of Numba says and compares what these do."""

from __future__ import annotations

import numba
import numpy as np
import pytest
from numba.core.compiler import Flags

from pipeline import kernel_cache  # noqa: F401  (replaces the functions)


@numba.njit
def fill(target: np.ndarray, values: np.ndarray) -> None:
    target[1:] = values


def test_slice_of_another_shape_is_an_error() -> None:
    target = np.zeros(4)
    fill(target, np.ones(3))
    assert target.tolist() == [0.0, 1.0, 1.0, 1.0]
    with pytest.raises(ValueError, match="cannot assign slice from input of different size"):
        fill(target, np.ones(2))


def test_flags_are_equal_where_all_options_have_equal_values() -> None:
    plain, stated, other = Flags(), Flags(), Flags()
    stated.nrt = plain.nrt  # the default
    other.nrt = not plain.nrt
    assert plain == stated == plain.copy()
    assert hash(plain) == hash(stated)
    assert plain != other
    assert stated != other
    assert plain != "flags"
