"""The figure of the strictness levels shows what the levels admit."""

from __future__ import annotations

from shipped_kits.strictness_figure import DOOR, FLOOR, OBSERVED, REFUSED, WALL, newly_admitted
from stages.shape.graphs.neighbourhoods import STRICTNESS


def test_levels_show_what_they_add_and_nothing_that_is_refused() -> None:
    levels = dict(newly_admitted())
    assert tuple(levels) == STRICTNESS
    assert set(levels["multiset"]) == set(OBSERVED)
    assert levels["count_and_set"] == [((WALL, 1), (FLOOR, 2))]
    assert ((WALL, 1), (FLOOR, 1)) in levels["count_and_pairs"]
    assert ((FLOOR, 2), (DOOR, 1)) in levels["count_and_pairs"]
    assert ((WALL, 1), (DOOR, 1)) in levels["count_and_types"]
    assert not {around for around, _ in REFUSED} & {around for added in levels.values() for around in added}
