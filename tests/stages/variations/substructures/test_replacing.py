"""Replacement as a method of the search: all of small languages, and nothing that the others would refuse."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from stages.shape.geometry.contact import ContactTest
from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.kit import Kit
from stages.variations.search.search import Search, Variant
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


def test_replacement_finds_chains_that_are_shorter_and_longer_up_to_the_limits() -> None:
    line, found = replaced(kit_of(CHAIN, [chain(3), chain(5)]), 2500, dummy_edges=0, max_size=1.4)
    assert (line.min_parts, line.max_parts) == (2, 10)
    assert {each.lineage["method"] for each in found} == {"substructures"}
    assert {2, 4, 6, 8} <= {len(each.assembly) - 2 for each in found}


def test_a_pair_that_is_used_up_brings_nothing_new_and_not_no_place() -> None:
    line, _ = replaced(kit_of(CHAIN, [chain(3), chain(4)]), 3000, dummy_edges=0, max_size=1.0)
    assert line.rejects["replaced: no embedding"] < 50
    assert line.rejects["duplicate"] > 1000


def test_what_a_piece_held_together_makes_room_for_a_longer_one() -> None:
    shapes = [row("cap", "link", "plate", "link", "link", "cap"), row("cap", "link", "link", "block", "link", "cap")]
    kit = kit_of(LINKS, shapes)
    _, found = replaced(kit, 1500, dummy_edges=1)
    names = [[kit.types[index].name for index in each.assembly.types] for each in found]
    whole = [each for each, parts in zip(found, names, strict=True) if parts.count("link") == 3 and len(parts) == 6]
    assert any(each.lineage["parts_from"] == [1, 5] for each in whole)


def test_a_ring_is_made_only_where_pieces_on_all_sides_change_at_once() -> None:
    """Some that no exemplar shows, all of them closed."""
    _, found = replaced(kit_of(ROAD, [ring(1, 1), ring(2, 3)]), 1000, max_size=1.6)
    assert {10, 12, 16} <= {len(each.assembly) for each in found}
    assert all(len(near) == 2 for each in found for near in each.assembly.neighbours())


def test_a_ring_that_no_rigid_piece_closes_is_not_made_by_the_order_of_docking_sites() -> None:
    line, found = replaced(kit_of(ROAD, [ring(1, 1), ring(2, 3)]), 1000, max_size=1.6, matching="centroid")
    assert found == []
    assert line.rejects["replaced: no embedding"] > 10


def test_the_graphs_and_neighbourhoods_of_results_are_those_that_geometry_has() -> None:
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


def test_replacement_is_the_same_every_time() -> None:
    kit = kit_of(CHAIN, [chain(3), chain(5)])
    runs = [replaced(kit, 800)[1] for _ in range(2)]
    first, second = ([each.lineage for each in run] for run in runs)
    assert first == second


def test_replacement_feeds_one_pool_with_the_other_methods() -> None:
    _, found = replaced(kit_of(CHAIN, [chain(3), chain(5)]), 4000, method="all", max_size=3.0)
    methods = Counter(each.lineage["method"] for each in found)
    assert methods["substructures"]
    assert len(methods) > 1


def test_shapes_of_one_name_are_told_apart() -> None:
    """A search that goes on in several runs of one name, in each of which it calls other variants alike."""
    line = Search(
        ContactOracle(kit_of(CHAIN, [chain(3), chain(5)])), SearchConfig(method="substructures", max_size=3.0)
    )
    rng = np.random.default_rng(0)
    found = [each for _ in range(12) for each in line.run(rng, 60, 10**9, "test", lambda count: None)[0]]
    assert len({len(each.assembly) for each in found}) > 4


def test_what_a_pair_of_shapes_brings_is_owed_to_the_choice_that_drew_it() -> None:
    """Fewer tries than a pair has operations: all are of one pair, whatever else was chosen meanwhile."""
    line, _ = replaced(kit_of(CHAIN, [chain(9), chain(12)]), 30)
    assert np.count_nonzero(line.operators._work) == 1


@pytest.mark.parametrize("repeats", [1, 4])
def test_recursive_rules_are_carried_out_several_times_at_once(repeats: int) -> None:
    kit = kit_of(CHAIN, [chain(7)])
    _, found = replaced(kit, 700, max_repeats=repeats, matching="centroid")
    several = [each for each in found if each.lineage["repeats"] > 1]
    assert all(each.lineage["repeats"] <= repeats for each in found)
    assert {len(each.assembly) > len(kit.exemplars[0].assembly) for each in several} == (
        {True, False} if repeats > 1 else set()
    )
    for each in several:
        assert sum(each.lineage["parts_from"]) == len(each.assembly)
