"""Substitution: complete on tables that can be listed by hand, right on everything it finds, the same every time."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from stages.shape.geometry.contact import ContactTest
from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.graphs.neighbourhoods import admits
from stages.shape.kit import Assembly, Kit
from stages.variations.kernels.operators import SUBSTITUTION
from stages.variations.search.search import Search
from stages.variations.search.variant import Variant
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


def test_substitution_finds_every_combination_of_top_and_legs_once(found: list[Variant]) -> None:
    tables = Counter(
        (int(variant.assembly.types[variant.assembly.types % 2 == 0][0]), int((variant.assembly.types == 3).sum()))
        for variant in found
    )
    every = {(top, legs) for top in (0, 2) for legs in range(5)} - {(0, 0), (2, 4)}
    assert tables == Counter(every)
    assert any(variant.lineage["method"] == "substitution" for variant in found)


def test_without_labels_nothing_can_be_exchanged() -> None:
    line, found = search(table_kit(table(THIN, SQUARE), table(THIN, ROUND), types="labels"), tries=1000)
    assert not found
    assert not any(way == SUBSTITUTION for _, way, _ in line.operators.choices)


def test_contacts_of_variants_are_recomputed_and_admitted_by_label(kit: Kit, found: list[Variant]) -> None:
    contact = ContactTest(kit.types, kit.contact_tolerance)
    for variant in found:
        assembly = variant.assembly
        assert np.array_equal(contact.contacts(assembly.types, assembly.poses), assembly.edges)
        labelled = kit.labelled(assembly)
        for part, neighbours in enumerate(labelled.neighbours()):
            assert admits(kit.grammar, int(labelled.types[part]), labelled.multiset(neighbours))


def test_equal_legs_end_at_one_level(found: list[Variant]) -> None:
    for variant in found:
        heights = variant.assembly.poses[variant.assembly.types % 2 == 1, 1, 3]
        assert np.ptp(heights) < 1e-6


def test_legs_of_different_lengths_are_never_mixed() -> None:
    kit = table_kit(table(THIN, SQUARE), table(THICK, SHORT))
    line, found = search(kit)
    assert sorted(sorted(variant.assembly.types.tolist()) for variant in found) == [[0, 3, 3, 3, 3], [1, 1, 1, 1, 2]]
    assert line.rejects["lifted off the ground"] > 0
    for variant in found:
        top = variant.assembly.types % 2 == 0
        thickness = kit.types[int(variant.assembly.types[top][0])].bounds[1, 1]
        for part_type, height in zip(
            variant.assembly.types[~top].tolist(), variant.assembly.poses[~top, 1, 3], strict=True
        ):
            drop = variant.assembly.poses[top, 1, 3][0] - height
            assert drop == pytest.approx(thickness + (0.5 if part_type == 1 else 0.25), abs=1e-6)


def test_legs_are_placed_where_legs_of_that_top_were() -> None:
    _, found = search(table_kit(table(THIN, SQUARE), table(THICK, ROUND, reach=0.6)), tries=10_000)
    assert len(found) == 8
    for variant in found:
        tops = variant.assembly.types % 2 == 0
        places = variant.assembly.poses[~tops, :3, 3] - variant.assembly.poses[tops, :3, 3]
        reach = 0.8 if variant.assembly.types[tops][0] == 0 else 0.6
        assert np.abs(places[:, [0, 2]]) == pytest.approx(np.full((4, 2), reach), abs=1e-6)


def test_same_seed_gives_same_variants(kit: Kit, found: list[Variant]) -> None:
    _, again = search(kit)
    assert [entry.lineage for entry in again] == [variant.lineage for variant in found]
    for one, other in zip(found, again, strict=True):
        assert one.assembly.poses.tobytes() == other.assembly.poses.tobytes()


def test_lineage_counts_parts_by_parent(kit: Kit, found: list[Variant]) -> None:
    for variant in found:
        lineage = variant.lineage
        assert sum(lineage["parts_from"]) >= len(variant.assembly)
        if lineage["method"] == "substitution":
            assert sum(lineage["parts_from"]) == len(variant.assembly)
            assert len(lineage["boundary"]) == len(lineage["images"]) > 0


def row(types: list[int]) -> Assembly:
    edges = np.array([(k, k + 1) for k in range(len(types) - 1)], dtype=np.int32).reshape(-1, 2)
    return Assembly(np.array(types, dtype=np.int16), np.tile(np.eye(4), (len(types), 1, 1)), edges)


def test_drawn_pieces_are_all_parts_of_labels_or_one_group() -> None:
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


def test_no_piece_is_drawn_where_nothing_would_stay() -> None:
    assert draw_pieces(np.random.default_rng(0), row([0, 0]), row([0])) is None
