"""Substitution: complete on tables that can be listed by hand, right on everything it finds, the same every time."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from stages.shape.geometry.contact import ContactTest
from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.graphs.neighbourhoods import admits
from stages.shape.kit import Assembly, Kit
from stages.variations.kernels.structs import MEANINGS
from stages.variations.search.search import Search, Variant
from stages.variations.settings import SearchConfig
from stages.variations.substitution.pieces import draw_pieces
from tests.toy_kits.tables import ROUND, SHORT, SQUARE, THICK, THIN, table, table_kit


@pytest.fixture(scope="module")
def kit() -> Kit:
    return table_kit(table(THIN, SQUARE), table(THICK, ROUND))


def search(kit: Kit, seed: int = 0, tries: int = 3000) -> tuple[Search, list[Variant]]:
    line = Search(ContactOracle(kit), SearchConfig())
    found, _ = line.run(np.random.default_rng(seed), tries, 10**9, "test", lambda count: None)
    return line, found


@pytest.fixture(scope="module")
def found(kit: Kit) -> list[Variant]:
    return search(kit)[1]


def test_every_top_stands_on_every_mixture_of_legs_once(found: list[Variant]) -> None:
    tables = Counter(
        (int(each.assembly.types[each.assembly.types % 2 == 0][0]), int((each.assembly.types == 3).sum()))
        for each in found
    )
    every = {(top, legs) for top in (0, 2) for legs in range(5)} - {(0, 0), (2, 4)}
    assert tables == Counter(every)
    assert any(each.lineage["method"] == "substitution" for each in found)


def test_without_meanings_nothing_can_be_exchanged() -> None:
    line, found = search(table_kit(table(THIN, SQUARE), table(THIN, ROUND), types="labels"), tries=1000)
    assert not found
    assert not any(way == MEANINGS for _, way, _ in line.operators.choices)


def test_what_is_found_touches_as_it_says_and_is_admitted_by_label(kit: Kit, found: list[Variant]) -> None:
    contact = ContactTest(kit.types, kit.contact_tolerance)
    for each in found:
        assembly = each.assembly
        assert np.array_equal(contact.contacts(assembly.types, assembly.poses), assembly.edges)
        labelled = kit.labelled(assembly)
        for part, neighbours in enumerate(labelled.neighbours()):
            assert admits(kit.grammar, int(labelled.types[part]), labelled.multiset(neighbours))


def test_feet_stand_on_one_level_where_the_legs_are_as_long(found: list[Variant]) -> None:
    for each in found:
        heights = each.assembly.poses[each.assembly.types % 2 == 1, 1, 3]
        assert np.ptp(heights) < 1e-6


def test_legs_of_another_length_hang_from_the_top_and_never_beside_longer_ones() -> None:
    kit = table_kit(table(THIN, SQUARE), table(THICK, SHORT))
    line, found = search(kit)
    assert sorted(sorted(each.assembly.types.tolist()) for each in found) == [[0, 3, 3, 3, 3], [1, 1, 1, 1, 2]]
    assert line.rejects["lifted off the ground"] > 0
    for each in found:
        top = each.assembly.types % 2 == 0
        thickness = kit.types[int(each.assembly.types[top][0])].bounds[1, 1]
        for part_type, height in zip(each.assembly.types[~top].tolist(), each.assembly.poses[~top, 1, 3], strict=True):
            drop = each.assembly.poses[top, 1, 3][0] - height
            assert drop == pytest.approx(thickness + (0.5 if part_type == 1 else 0.25), abs=1e-6)


def test_every_leg_stands_where_legs_of_its_top_stood() -> None:
    _, found = search(table_kit(table(THIN, SQUARE), table(THICK, ROUND, reach=0.6)), tries=10_000)
    assert len(found) == 8
    for each in found:
        tops = each.assembly.types % 2 == 0
        places = each.assembly.poses[~tops, :3, 3] - each.assembly.poses[tops, :3, 3]
        reach = 0.8 if each.assembly.types[tops][0] == 0 else 0.6
        assert np.abs(places[:, [0, 2]]) == pytest.approx(np.full((4, 2), reach), abs=1e-6)


def test_the_same_seed_finds_the_same(kit: Kit, found: list[Variant]) -> None:
    _, again = search(kit)
    assert [each.lineage for each in again] == [each.lineage for each in found]
    for one, other in zip(found, again, strict=True):
        assert one.assembly.poses.tobytes() == other.assembly.poses.tobytes()


def test_a_lineage_says_what_came_from_where(kit: Kit, found: list[Variant]) -> None:
    for each in found:
        lineage = each.lineage
        assert sum(lineage["parts_from"]) >= len(each.assembly)
        if lineage["method"] == "substitution":
            assert sum(lineage["parts_from"]) == len(each.assembly)
            assert len(lineage["boundary"]) == len(lineage["images"]) > 0


def row(types: list[int]) -> Assembly:
    edges = np.array([(k, k + 1) for k in range(len(types) - 1)], dtype=np.int32).reshape(-1, 2)
    return Assembly(np.array(types, dtype=np.int16), np.tile(np.eye(4), (len(types), 1, 1)), edges)


def test_pieces_are_all_parts_of_their_labels_or_one_connected_group() -> None:
    base, giver = row([0, 1, 0, 2, 1]), row([1, 2, 0, 1])
    sizes = set()
    for seed in range(300):
        drawn = draw_pieces(np.random.default_rng(seed), base, giver)
        if drawn is None:
            continue
        assert drawn.piece.any()
        assert not drawn.piece.all()
        assert not drawn.taken.all()
        labels = set(base.types[drawn.taken].tolist()) | set(giver.types[drawn.piece].tolist())
        for assembly, chosen in ((base, drawn.taken), (giver, drawn.piece)):
            whole = np.isin(assembly.types, sorted(labels))
            parts = np.flatnonzero(chosen)
            assert np.array_equal(chosen, whole) or (np.diff(parts) == 1).all()
        sizes.add((int(drawn.taken.sum()), int(drawn.piece.sum())))
    assert {(2, 1), (1, 1), (2, 2)} <= sizes


def test_nothing_is_drawn_where_nothing_would_stay() -> None:
    assert draw_pieces(np.random.default_rng(0), row([0, 0]), row([0])) is None
