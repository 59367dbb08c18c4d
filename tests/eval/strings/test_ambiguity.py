"""How much graphs leave open of their shapes, on networks of which it is known."""

from __future__ import annotations

import numpy as np
import pytest

from eval.strings.ambiguity import Ambiguity, ambiguity, ambiguity_table
from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.kit import Assembly
from stages.string_sampling.instantiation.instantiate import Instantiator
from tests.stages.training.edge_categories.networks import kit, network, writer


@pytest.fixture(scope="module")
def maker() -> Instantiator:
    return Instantiator(ContactOracle(kit()))


def looked_at(maker: Instantiator, *shapes: Assembly) -> Ambiguity:
    return ambiguity(maker, writer(), shapes, 8, np.random.default_rng(0))


def test_two_posts_and_a_rod_can_stand_in_one_way_only(maker: Instantiator) -> None:
    row = network(0, 2)
    plain = row.select(np.flatnonzero(row.types != kit().labels.index("sign")))
    assert len(plain) == 3
    assert looked_at(maker, plain) == Ambiguity(1, 8, 1.0, 100.0, 100.0)


def test_a_graph_does_not_say_at_which_side_of_a_post_a_sign_hangs(maker: Instantiator) -> None:
    """Ahead of the rod, or at one of two sides, which are each other's mirror images: two shapes."""
    found = looked_at(maker, *(network(seed, 2) for seed in range(8)))
    assert found.graphs == 8
    assert 1.5 < found.shapes <= 2
    assert 0 < found.open < found.tokens < 100


def test_what_has_no_string_is_left_out(maker: Instantiator) -> None:
    whole = network(1)
    apart = whole.select(np.array([0, len(whole) - 2]))
    found = looked_at(maker, apart, network(2, 2))
    assert found.graphs == 1
    assert looked_at(maker, apart) == Ambiguity(0, 8, 0.0, 0.0, 0.0)


def test_a_kit_is_a_row() -> None:
    (row,) = ambiguity_table([("toy", Ambiguity(3, 8, 2.5, 90.0, 80.0))]).rows
    assert row == ("toy", 3, 8, 2.5, 90.0, 80.0)
