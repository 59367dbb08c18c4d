"""Ambiguity of graphs, on networks with known ambiguity."""

from __future__ import annotations

import numpy as np
import pytest

from eval.strings.ambiguity import Ambiguity, ambiguity, ambiguity_table
from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.kit import Assembly
from stages.string_sampling.instantiation.instantiate import Instantiator
from tests.stages.training.edge_categories.networks import kit, network, writer


@pytest.fixture(scope="module")
def instantiator() -> Instantiator:
    return Instantiator(ContactOracle(kit()))


def measured(instantiator: Instantiator, *shapes: Assembly) -> Ambiguity:
    return ambiguity(instantiator, writer(), shapes, 8, np.random.default_rng(0))


def test_two_posts_and_a_rod_have_one_shape(instantiator: Instantiator) -> None:
    row = network(0, 2)
    plain = row.select(np.flatnonzero(row.types != kit().labels.index("sign")))
    assert len(plain) == 3
    assert measured(instantiator, plain) == Ambiguity(1, 8, 1.0, 100.0, 100.0)


def test_side_of_a_sign_is_ambiguous(instantiator: Instantiator) -> None:
    """Ahead of the rod, or at one of two sides, which are each other's mirror images: two shapes."""
    found = measured(instantiator, *(network(seed, 2) for seed in range(8)))
    assert found.graphs == 8
    assert 1.5 < found.shapes <= 2
    assert 0 < found.open < found.tokens < 100


def test_disconnected_shapes_are_left_out(instantiator: Instantiator) -> None:
    whole = network(1)
    apart = whole.select(np.array([0, len(whole) - 2]))
    found = measured(instantiator, apart, network(2, 2))
    assert found.graphs == 1
    assert measured(instantiator, apart) == Ambiguity(0, 8, 0.0, 0.0, 0.0)


def test_table_has_a_row_per_kit() -> None:
    (row,) = ambiguity_table([("toy", Ambiguity(3, 8, 2.5, 90.0, 80.0))]).rows
    assert row == ("toy", 3, 8, 2.5, 90.0, 80.0)
