"""Local patterns of chains, whose parts and neighbours can be counted by hand."""

from __future__ import annotations

import pytest

from stages.shape.geometry.docking import DockingTable
from stages.shape.graphs.patterns import Pattern, observed_patterns, unique_pattern_share
from stages.shape.kit import Kit
from tests.toy_kits.chains_and_rings import CHAIN, box, chain, kit_of

PLAIN = {"cap": box(0.5, 1.0, 1.0), "link": box(1.0, 0.2, 0.6)}


def named(kit: Kit, patterns: list[Pattern]) -> list[tuple[str, str, float]]:
    """The part in the middle, what stands around it, and how often that was seen."""
    names = kit.type_names()
    return sorted(
        (names[pattern.part_type], " ".join(names[t] for t in pattern.types), pattern.seen) for pattern in patterns
    )


def test_patterns_of_arrows_tell_their_two_ends_apart() -> None:
    kit = kit_of(CHAIN, [chain(3), chain(5)])
    patterns = observed_patterns(kit, DockingTable.of(kit), upright=True)
    ends = [("cap", "link", 2), ("link", "cap link", 2)]
    assert named(kit, patterns) == sorted([*ends, *ends, ("link", "link link", 4)])
    assert unique_pattern_share(patterns) == 0.0


def test_patterns_are_one_modulo_the_symmetries_of_the_part() -> None:
    kit = kit_of(PLAIN, [chain(3), chain(5)])
    patterns = observed_patterns(kit, DockingTable.of(kit), upright=True)
    assert named(kit, patterns) == [("cap", "link", 4), ("link", "cap link", 4), ("link", "link link", 4)]


def test_a_pattern_belongs_to_the_exemplar_that_showed_it_first() -> None:
    kit = kit_of(CHAIN, [chain(1), chain(5)])
    owners = {
        (pattern.owner, *seen)
        for pattern in observed_patterns(kit, DockingTable.of(kit), upright=True)
        for seen in named(kit, [pattern])
    }
    assert owners == {
        (0, "cap", "link", 2),
        (0, "link", "cap cap", 1),
        (1, "link", "cap link", 1),
        (1, "link", "link link", 3),
    }


@pytest.mark.parametrize(("lengths", "share"), [((1,), 1.0), ((4,), 4 / 6), ((1, 5), 3 / 10), ((3, 5), 0.0)])
def test_share_of_parts_whose_pattern_no_other_shows(lengths: tuple[int, ...], share: float) -> None:
    kit = kit_of(CHAIN, [chain(length) for length in lengths])
    assert unique_pattern_share(observed_patterns(kit, DockingTable.of(kit), upright=True)) == pytest.approx(share)
