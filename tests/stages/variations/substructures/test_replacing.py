"""Replacement as a method of the search: all of small languages, and nothing that the others would refuse."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from stages.shape.geometry.contact import ContactTest
from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.kit import Kit
from stages.variations.search.search import Search
from stages.variations.search.variant import Variant
from stages.variations.settings import SearchConfig
from tests.toy_kits.chains_and_rings import CHAIN, ROAD, Placed, box, chain, kit_of, pose, ring, with_arrow


def replaced(kit: Kit, tries: int, **settings: object) -> tuple[Search, list[Variant]]:
    line = Search(ContactOracle(kit), SearchConfig.model_validate({"method": "substructures", **settings}))
    found, _ = line.run(np.random.default_rng(0), tries, 10**9, "test", lambda count: None)
    return line, found


LINKS = {**CHAIN, "plate": with_arrow(box(0.7, 0.2, 0.8)), "block": with_arrow(box(1.6, 0.2, 0.8))}


def row(*names: str) -> list[Placed]:
    """Parts in a row along x, each against the one before."""
    placed, end = [], 0.0
    for name in names:
        length = float(np.ptp(LINKS[name].vertices[:, 0]))
        placed.append((name, pose(end + length / 2, 0, 0)))
        end += length
    return placed


def test_replacement_finds_chains_up_to_the_limits() -> None:
    line, found = replaced(kit_of(CHAIN, [chain(3), chain(5)]), 2500, dummy_edges=0, max_size=1.4)
    assert (line.maker.min_parts, line.maker.max_parts) == (2, 10)
    assert {variant.lineage["method"] for variant in found} == {"substructures"}
    assert {2, 4, 6, 8} <= {len(variant.assembly) - 2 for variant in found}


def test_exhausted_pair_gives_duplicates() -> None:
    line, _ = replaced(kit_of(CHAIN, [chain(3), chain(4)]), 3000, dummy_edges=0, max_size=1.0)
    assert line.rejects["replaced: no embedding"] < 50
    assert line.rejects["duplicate"] > 1000


def test_separate_bodies_make_room_for_a_longer_piece() -> None:
    shapes = [row("cap", "link", "plate", "link", "link", "cap"), row("cap", "link", "link", "block", "link", "cap")]
    kit = kit_of(LINKS, shapes)
    _, found = replaced(kit, 1500, dummy_edges=1)
    names = [[kit.types[index].name for index in variant.assembly.types] for variant in found]
    whole = [
        variant for variant, parts in zip(found, names, strict=True) if parts.count("link") == 3 and len(parts) == 6
    ]
    assert any(variant.lineage["parts_from"] == [1, 5] for variant in whole)


def test_ring_needs_replacement_on_all_sides_at_once() -> None:
    """Some that no exemplar shows, all of them closed."""
    _, found = replaced(kit_of(ROAD, [ring(1, 1), ring(2, 3)]), 1000, max_size=1.6)
    assert {10, 12, 16} <= {len(variant.assembly) for variant in found}
    assert all(len(near) == 2 for variant in found for near in variant.assembly.neighbours())


def test_ring_that_no_rigid_piece_closes_is_not_made() -> None:
    line, found = replaced(kit_of(ROAD, [ring(1, 1), ring(2, 3)]), 1000, max_size=1.6, matching="centroid")
    assert found == []
    assert line.rejects["replaced: no embedding"] > 10


def test_graphs_of_results_agree_with_geometry() -> None:
    kit = kit_of(
        LINKS, [row("cap", "link", "plate", "link", "cap"), row("cap", "link", "block", "link", "link", "cap")]
    )
    contact = ContactTest(kit.types, kit.contact_tolerance)
    _, found = replaced(kit, 1500)
    assert len(found) >= 3
    for variant in found:
        assembly = variant.assembly
        edges = contact.contacts(assembly.types, assembly.poses)
        kinds = [contact.kind(*assembly.types[[i, j]].tolist(), _relative(assembly.poses, i, j)) for i, j in edges]
        counted = edges[[kind in kit.contact_kinds for kind in kinds]]
        np.testing.assert_array_equal(counted, assembly.edges)
        for part, neighbours in enumerate(assembly.neighbours()):
            assert assembly.multiset(neighbours) in kit.grammar.neighbourhoods[int(assembly.types[part])]


def _relative(poses: np.ndarray, i: int, j: int) -> np.ndarray:
    pose: np.ndarray = np.linalg.inv(poses[i]) @ poses[j]
    return pose


def test_replacement_is_deterministic() -> None:
    kit = kit_of(CHAIN, [chain(3), chain(5)])
    runs = [replaced(kit, 800)[1] for _ in range(2)]
    first, second = ([entry.lineage for entry in run] for run in runs)
    assert first == second


def test_replacement_feeds_one_pool_with_the_other_methods() -> None:
    _, found = replaced(kit_of(CHAIN, [chain(3), chain(5)]), 4000, method="all", max_size=3.0)
    methods = Counter(variant.lineage["method"] for variant in found)
    assert methods["substructures"]
    assert len(methods) > 1


def test_shapes_with_equal_names_are_distinguished() -> None:
    """A search that continues in several runs of one name, which reuse the names of variants."""
    line = Search(
        ContactOracle(kit_of(CHAIN, [chain(3), chain(5)])), SearchConfig(method="substructures", max_size=3.0)
    )
    rng = np.random.default_rng(0)
    found = [entry for _ in range(12) for entry in line.run(rng, 60, 10**9, "test", lambda count: None)[0]]
    assert len({len(variant.assembly) for variant in found}) > 4


def test_gain_of_a_pair_counts_for_the_try_that_drew_it() -> None:
    """Fewer tries than a pair has operations: all are of one pair, whatever else was chosen meanwhile."""
    line, _ = replaced(kit_of(CHAIN, [chain(9), chain(12)]), 30)
    assert np.count_nonzero(line.operators._work) == 1


@pytest.mark.parametrize("repeats", [1, 4])
def test_recursive_rules_are_repeated(repeats: int) -> None:
    kit = kit_of(CHAIN, [chain(7)])
    _, found = replaced(kit, 700, max_repeats=repeats, matching="centroid")
    several = [variant for variant in found if variant.lineage["repeats"] > 1]
    assert all(variant.lineage["repeats"] <= repeats for variant in found)
    assert {len(entry.assembly) > len(kit.exemplars[0].assembly) for entry in several} == (
        {True, False} if repeats > 1 else set()
    )
    for entry in several:
        assert sum(entry.lineage["parts_from"]) == len(entry.assembly)
