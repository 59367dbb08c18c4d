"""The order of docking sites depends on where neighbours stand, not on how the part is turned or they are numbered."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from stages.variations.substructures.docking_sites import cyclic_order

AXES = np.array([[0.0, 1, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])


def cyclic(order: list[int]) -> tuple[int, ...]:
    """The same for orders that differ in where they begin."""
    at = order.index(min(order))
    return tuple(order[at:] + order[:at])


def test_sites_around_the_vertical_go_counter_clockwise() -> None:
    sites = np.array([[1.0, 0, 0], [-1, 0, 0], [0, 0, 1], [0, 0, -1]])
    assert cyclic(cyclic_order(sites, AXES)) == (0, 3, 1, 2)


@given(seed=st.integers(0, 10_000), turn=st.floats(0, 6.28), count=st.integers(3, 8))
def test_cyclic_order_turns_with_the_shape(seed: int, turn: float, count: int) -> None:
    sites = np.random.default_rng(seed).normal(size=(count, 3))
    turned = Rotation.from_rotvec([0, turn, 0]).as_matrix()
    assert cyclic(cyclic_order(sites, AXES)) == cyclic(cyclic_order(sites @ turned.T, AXES @ turned.T))


@given(seed=st.integers(0, 10_000), count=st.integers(3, 8))
def test_cyclic_order_does_not_depend_on_numbering(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    sites, names = rng.normal(size=(count, 3)), rng.permutation(count)
    order = cyclic_order(sites, AXES)
    assert cyclic([int(names[name]) for name in cyclic_order(sites[names], AXES)]) == cyclic(order)


@pytest.mark.parametrize(
    "sites",
    [
        np.zeros((0, 3)),
        np.array([[1.0, 0, 0]]),
        np.array([[1.0, 0, 0], [-1, 0, 0]]),
        np.array([[1.0, 0, 0], [2, 0, 0], [-1, 0, 0]]),  # collinear
        np.array([[0.0, 1, 0], [0, 2, 0], [0, -1, 0]]),  # collinear and upright
        np.array([[0.0, 0, 0], [0, 0, 0], [0, 0, 0]]),  # in one point
        np.array([[1.0, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]]),  # no plane fits best
    ],
)
def test_order_of_degenerate_neighbourhoods_does_not_depend_on_numbering(sites: np.ndarray) -> None:
    order = cyclic_order(sites, AXES)
    assert sorted(order) == list(range(len(sites)))
    back = cyclic_order(sites[::-1], AXES)
    if len(np.unique(sites, axis=0)) == len(sites) and len(sites) > 2:
        assert cyclic([len(sites) - 1 - entry for entry in back]) == cyclic(order)
