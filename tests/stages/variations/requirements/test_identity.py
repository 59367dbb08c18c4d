"""Identity: labels of the exemplars stay, in about their shares."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.errors import ConfigError
from stages.autoconfig.trial_search import TrialSearch
from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.kit import Kit
from stages.variations.kernels.checks import keeps_types
from stages.variations.kernels.structs import N_PARTS
from stages.variations.kernels.tables import kit_tables, workspace
from stages.variations.requirements.identity import common_labels, label_counts, out_of_bounds, share_bounds
from stages.variations.search.search import Search
from stages.variations.search.variant import OUT_OF_PROPORTION
from stages.variations.settings import SearchConfig
from tests.toy_kits.chains_and_rings import CHAIN, ROAD, Placed, box, chain, kit_of, ring, with_arrow

GATED_ROAD = {**ROAD, "gate": with_arrow(box(1.0, 0.3, 0.6))}


def gated_ring(width: int, depth: int) -> list[Placed]:
    """A ring one of whose straights is a gate."""
    tiles = ring(width, depth)
    first = next(number for number, (name, _) in enumerate(tiles) if name == "straight")
    return [("gate", at) if number == first else (name, at) for number, (name, at) in enumerate(tiles)]


def test_bounds_are_the_shares_of_the_exemplars_widened_by_the_factor() -> None:
    kit = kit_of(CHAIN, [chain(3), chain(5)])
    assert common_labels(kit) == ("cap", "link")
    np.testing.assert_allclose(share_bounds(kit, ["cap"], 2.0), [[2 / 7 / 2, 2 * 2 / 5], [0.0, np.inf]])
    with pytest.raises(ConfigError, match=r"keep_types: kit toy has no parts called cup; did you mean cap"):
        share_bounds(kit, ["cup"])


def test_label_of_one_exemplar_alone_is_free_unless_it_is_named() -> None:
    kit = kit_of(GATED_ROAD, [ring(2, 2), gated_ring(2, 2)])
    assert set(common_labels(kit)) == {"corner", "straight"}
    gate = kit.labels.index("gate")
    np.testing.assert_allclose(share_bounds(kit, ["gate"], 1.0)[gate], [1 / 12, 1 / 12])


def test_bounds_are_rounded_outwards_to_whole_parts() -> None:
    bounds = np.array([[0.1, 0.2], [0.0, np.inf]])
    counts = np.array([[1, 1], [0, 5], [1, 18], [1, 28], [2, 27], [4, 11], [3, 11]])
    assert out_of_bounds(bounds, counts)[:, 0].tolist() == [False, True, False, True, False, True, False]
    assert not out_of_bounds(bounds, counts)[:, 1].any()


def rectangles(kit: Kit, *labels: str) -> tuple[Search, np.ndarray]:
    line = Search(
        ContactOracle(kit), SearchConfig(method="exchange", max_size=4.0), shares=share_bounds(kit, labels, 2.0)
    )
    found, _ = line.run(np.random.default_rng(0), 3000, 10**9, "test", lambda count: None)
    types = [np.bincount(variant.assembly.types, minlength=len(kit.types)) for variant in found]
    return line, label_counts(kit, np.array(types))[:, kit.labels.index("gate")]


def test_search_keeps_a_rare_part_that_it_would_lose_or_repeat() -> None:
    kit = kit_of(GATED_ROAD, [gated_ring(3, 2)])
    _, free = rectangles(kit)
    line, kept = rectangles(kit, *common_labels(kit))
    assert free.min() == 0
    assert len(kept) > 3
    assert kept.min() >= 1
    assert line.rejects[OUT_OF_PROPORTION] > 0
    assert line.out_of_proportion[kit.labels.index("gate")] > 0


@settings(max_examples=60, deadline=None)
@given(st.lists(st.integers(0, 2), min_size=1, max_size=40), st.floats(1.0, 5.0))
def test_compiled_test_agrees_with_counts(types: list[int], factor: float) -> None:
    kit = kit_of(GATED_ROAD, [gated_ring(3, 2)])
    bounds = share_bounds(kit, common_labels(kit), factor)
    room = workspace(50)
    room.types[: len(types)] = types
    room.counts[N_PARTS] = len(types)
    counts = label_counts(kit, np.bincount(types, minlength=3)[None])
    assert keeps_types(kit_tables(kit, True, bounds), room) == (not out_of_bounds(bounds, counts).any())


def test_trial_search_keeps_labels_and_gives_up_those_that_cannot_be_kept() -> None:
    kit = kit_of(GATED_ROAD, [gated_ring(3, 2)], row_neighbourhoods=False)
    search = TrialSearch(ContactOracle(kit), np.random.default_rng(1), keep_types=common_labels(kit))
    result = search.run(500, 12)
    assert result.graphs >= 10
    assert result.lost_labels == ()
