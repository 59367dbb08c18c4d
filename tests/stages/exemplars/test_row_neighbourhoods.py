"""Neighbourhoods that follow from rows: the middle of a row of two, and the ends of a row of one."""

from __future__ import annotations

from stages.shape.kit import Kit
from tests.stages.rows import models
from tests.toy_kits.chains_and_rings import CHAIN, ROAD, box, chain, kit_of, pose, ring


def around(kit: Kit, label: str) -> dict[frozenset[tuple[str, int]], int]:
    """Return how often each neighbourhood of a label was seen."""
    rules = kit.grammar.neighbourhoods[kit.labels.index(label)]
    return {frozenset((kit.labels[other], count) for other, count in near): seen for near, seen in rules.items()}


def test_a_row_of_two_shows_what_its_middle_would_be() -> None:
    kit = kit_of(CHAIN, [chain(2)])
    ends, middle, alone = [("cap", 1), ("link", 1)], [("link", 2)], [("cap", 2)]
    assert around(kit, "link") == {frozenset(ends): 2, frozenset(middle): 0, frozenset(alone): 0}
    assert around(kit, "cap") == {frozenset([("link", 1)]): 2}


def test_rows_in_two_directions_show_the_inside_of_a_floor() -> None:
    tiles = [("tile", pose(float(x), 0.0, float(z))) for x in range(2) for z in range(2)]
    kit = kit_of({"tile": box(1.0, 0.1, 1.0)}, [tiles])
    assert around(kit, "tile")[frozenset([("tile", 4)])] == 0
    assert around(kit, "tile")[frozenset([("tile", 2)])] == 4


def test_only_what_is_observed_counts_where_rows_are_left_out() -> None:
    kit = kit_of(CHAIN, [chain(2)], row_neighbourhoods=False)
    assert around(kit, "link") == {frozenset([("cap", 1), ("link", 1)]): 2}


def test_nothing_follows_without_rows_or_where_a_part_would_become_longer() -> None:
    shelf, _ = models.shelf()
    for kit in (kit_of(ROAD, [ring(1, 1)]), shelf):
        assert all(seen > 0 for rules in kit.grammar.neighbourhoods.values() for seen in rules.values())
