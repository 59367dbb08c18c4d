"""Growth: complete on languages known by heart, made of nothing but observed patterns, of the size asked for."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.geometry.docking import DockingTable
from stages.shape.graphs.patterns import observed_patterns
from stages.shape.kit import Exemplar, Kit
from stages.variations.search.search import Search
from stages.variations.search.variant import Variant
from stages.variations.settings import SearchConfig
from tests.stages.variations.search.test_search import SHIPPED, shipped_kit
from tests.toy_kits.chains_and_rings import CHAIN, ROAD, chain, kit_of, ring


def grown(kit: Kit, tries: int = 20_000, wanted: int = 10**9, **settings: object) -> tuple[Search, list[Variant]]:
    line = Search(ContactOracle(kit), SearchConfig.model_validate({"method": "growth", **settings}))
    found, _ = line.run(np.random.default_rng(5), tries, wanted, "test", lambda count: None)
    return line, found


def test_growth_finds_every_chain_within_the_limits() -> None:
    kit = kit_of(CHAIN, [chain(3), chain(5)])
    _, found = grown(kit, min_size=0.5, max_size=2.0)
    assert sorted(len(variant.assembly) - 2 for variant in found) == [2, 4, *range(6, 13)]


def test_growth_finds_every_rectangle_and_only_closed_rings() -> None:
    kit = kit_of(ROAD, [ring(1, 1), ring(2, 3)])
    _, found = grown(kit, tries=60_000, min_size=1.0, max_size=1.6)
    sides = Counter()
    for variant in found:
        degrees = np.bincount(variant.assembly.edges.ravel(), minlength=len(variant.assembly))
        assert (degrees == 2).all()
        places = variant.assembly.poses[:, :3, 3]
        corners = places[np.array([kit.types[t].name == "corner" for t in variant.assembly.types])]
        sides[tuple((np.round(np.sort(np.ptp(corners, axis=0))[1:]).astype(int) - 1).tolist())] += 1
    expected = {(a, b) for a in range(1, 10) for b in range(a, 10) if 8 <= 4 + 2 * (a + b) <= 22} - {(1, 1), (2, 3)}
    # Long thin rings need fields that are drawn now and then only.
    assert set(sides) <= expected
    assert set(sides) >= {entry for entry in expected if sum(entry) <= 7}
    assert set(sides.values()) == {1}


@pytest.mark.parametrize("folder", SHIPPED, ids=lambda folder: folder.name)
def test_grown_shapes_have_only_observed_patterns(folder: Path) -> None:
    kit = shipped_kit(folder)
    known = len(observed_patterns(kit, DockingTable.of(kit), upright=True))
    _, found = grown(kit, wanted=12)
    assert len(found) >= 12
    for variant in found:
        both = (*kit.exemplars, Exemplar("variant", variant.assembly, ("",) * len(variant.assembly)))
        assert len(observed_patterns(replace(kit, exemplars=both), DockingTable.of(kit), upright=True)) == known
        assert variant.lineage["method"] == "growth"
        assert sum(variant.lineage["parts_from"]) == len(variant.assembly)


def test_grown_size_and_footprint_are_met_within_a_quarter() -> None:
    kit = shipped_kit(next(entry for entry in SHIPPED if entry.name == "castle"))
    _, found = grown(kit, wanted=10, grown={"parts": (40, 60)})
    assert len(found) >= 10
    assert all(30 <= len(variant.assembly) <= 75 for variant in found)
    _, found = grown(kit, wanted=10, min_size=0.1, grown={"footprint": (14.0, 20.0)})
    assert len(found) >= 10
    for variant in found:
        area = float(variant.features[1])
        assert 14 * 20 * 0.75**2 <= area <= 14 * 20 * 1.25**2


def test_growth_is_deterministic_whatever_contacts_are_known() -> None:
    kit = shipped_kit(SHIPPED[0])
    answers = ContactOracle(kit)
    runs = []
    for given in (answers, answers, ContactOracle(kit)):
        line = Search(given, SearchConfig(method="growth"))
        found, tries = line.run(np.random.default_rng(2), 3000, 10**9, "test", lambda count: None)
        runs.append((tries, [variant.assembly.poses.tobytes() for variant in found], line.rejects))
    assert runs[0] == runs[1] == runs[2]


def test_errors_of_the_oracle_in_a_kernel_are_raised() -> None:
    line = Search(ContactOracle(kit_of(CHAIN, [chain(3)])), SearchConfig(method="growth"))
    line.oracle.contact.touches = None  # type: ignore[assignment,method-assign]
    with pytest.raises(TypeError):
        line.run(np.random.default_rng(0), 100, 1, "test", lambda count: None)
