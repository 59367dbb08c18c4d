"""How far variants are from exemplars as one sees them."""

from __future__ import annotations

import numpy as np
import pytest

from stages.autoconfig.moved_surface import MovedSurface
from stages.autoconfig.trial_search import MIN_MOVED_DISTANCE, TrialResult, has_low_diversity
from stages.shape.kit import Assembly, Kit
from tests.toy_kits.chains_and_rings import CHAIN, box, chain, kit_of, pose

BOLTED = {"block": box(4.0, 2.0, 2.0), "bolt": box(0.1, 0.1, 0.1)}


def bolted(bolts: int) -> list[tuple[str, np.ndarray]]:
    """A block with bolts in a row on it, the first and the last at its ends."""
    places = [-1.9, 1.9, *np.linspace(-1.5, 1.5, bolts - 2)]
    return [("block", pose(0.0, 0.0, 0.0)), *(("bolt", pose(x, 1.05, 0.0)) for x in places)]


def only(kit: Kit) -> Assembly:
    return kit.exemplars[0].assembly


def test_exemplar_moves_nothing_wherever_it_stands() -> None:
    kit = kit_of(CHAIN, [chain(4)])
    moved = only(kit).poses.copy()
    moved[:, :3, 3] += [3.0, -2.0, 7.0]
    elsewhere = Assembly(only(kit).types, moved, only(kit).edges)
    assert MovedSurface(kit).distance([only(kit), elsewhere]) == pytest.approx(0.0, abs=1e-9)
    assert MovedSurface(kit).distance([]) == 0.0


def test_more_bolts_move_less_than_one_sees_and_a_longer_chain_moves_more() -> None:
    kits = [kit_of(BOLTED, [bolted(count)]) for count in (6, 9)]
    assert 0.0 < MovedSurface(kits[0]).distance([only(kits[1])]) < MIN_MOVED_DISTANCE
    chains = [kit_of(CHAIN, [chain(count)]) for count in (4, 6)]
    assert MovedSurface(chains[0]).distance([only(chains[1])]) > 2 * MIN_MOVED_DISTANCE


def test_the_nearest_exemplar_counts() -> None:
    kit = kit_of(CHAIN, [chain(4), chain(8)])
    assert MovedSurface(kit).distance([kit.exemplars[1].assembly]) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(("moved", "is_low"), [(0.015, True), (0.03, False)])
def test_hits_that_look_like_the_exemplar_have_low_diversity(moved: float, is_low: bool) -> None:
    trial = TrialResult(1000, 300, 300, distance=0.4, pair_distance=0.3, copied_share=0.6, moved=moved)
    assert has_low_diversity(trial) is trial.looks_like_exemplar is is_low
