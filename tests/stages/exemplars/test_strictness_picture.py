"""The picture of the levels shows what the levels admit."""

from __future__ import annotations

from stages.exemplars.strictness import DOOR, FLOOR, REFUSED, SEEN, WALL, newly_admitted
from stages.shape.graphs.neighbourhoods import STRICTNESS


def test_every_level_shows_what_it_adds_and_no_level_what_is_refused() -> None:
    levels = dict(newly_admitted())
    assert tuple(levels) == STRICTNESS
    assert set(levels["multiset"]) == set(SEEN)
    assert levels["count_and_set"] == [((WALL, 1), (FLOOR, 2))]
    assert ((WALL, 1), (FLOOR, 1)) in levels["count_and_pairs"]
    assert ((FLOOR, 2), (DOOR, 1)) in levels["count_and_pairs"]
    assert ((WALL, 1), (DOOR, 1)) in levels["count_and_types"]
    assert not {near for near, _ in REFUSED} & {each for added in levels.values() for each in added}
