"""Slots as seen, on a block with a place to its left and one to its right, and on shapes that growth makes of them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from stages.shape.geometry.contact import ContactTest
from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.geometry.docking import DockingTable
from stages.shape.graphs.neighbourhoods import SLOT_LEVELS, admits
from stages.shape.graphs.slots import SlotGrammar
from stages.shape.kit import Assembly, Kit
from stages.variations.search.search import Search
from stages.variations.settings import SearchConfig
from tests.stages.variations.search.test_search import SHIPPED, shipped_kit
from tests.toy_kits.chains_and_rings import Placed, box, kit_of, pose, with_arrow

BLOCKS = {"middle": with_arrow(box(1, 1, 1)), "red": box(1, 0.8, 0.8), "blue": box(1, 0.6, 0.7)}


def row(left: str, right: str) -> list[Placed]:
    neighbours = [(left, pose(-1, 0, 0)), (right, pose(1, 0, 0))]
    return [("middle", pose(0, 0, 0)), *((name, at) for name, at in neighbours if name)]


def built(kit: Kit, shape: list[Placed]) -> Assembly:
    names = kit.type_names()
    types = np.array([names.index(name) for name, _ in shape], dtype=np.int16)
    poses = np.array([at for _, at in shape])
    return Assembly(types, poses, ContactTest(kit.types, kit.contact_tolerance).contacts(types, poses))


def admitted(seen: list[tuple[str, str]], asked: tuple[str, str]) -> list[str]:
    """The levels that let the middle have `asked` to its left and right, where `seen` are all exemplars."""
    kit = kit_of(BLOCKS, [row(*types) for types in seen])
    shape = built(kit, row(*asked))
    return [
        level for level in SLOT_LEVELS if 0 not in SlotGrammar(kit, DockingTable.of(kit), True, level).misfits(shape)
    ]


@pytest.mark.parametrize(
    ("asked", "levels"),
    [
        (("red", "blue"), ["slot_pairs", "slot_fillings", "slots"]),
        (("blue", "red"), ["slot_pairs", "slot_fillings", "slots"]),
        (("red", "red"), ["slot_fillings", "slots"]),
        (("red", ""), []),
    ],
)
def test_pairs_ask_for_states_and_fillings_for_what_is_filled(asked: tuple[str, str], levels: list[str]) -> None:
    assert admitted([("red", "blue"), ("blue", "red")], asked) == levels


@pytest.mark.parametrize(("asked", "levels"), [(("red", "red"), ["slots"]), (("", "red"), list(SLOT_LEVELS))])
def test_level_slots_treats_slots_independently(asked: tuple[str, str], levels: list[str]) -> None:
    assert admitted([("red", ""), ("", "red")], asked) == levels


def test_what_was_never_seen_at_a_place_is_refused_by_all() -> None:
    assert admitted([("red", "blue"), ("red", "blue")], ("blue", "blue")) == []


def test_symmetric_parts_are_seen_from_all_sides() -> None:
    kit = kit_of({**BLOCKS, "middle": box(1, 1, 1)}, [row("red", ""), row("red", "")])
    turned = [(name, pose(0, 0, 0, 1) @ at) for name, at in row("red", "")]
    for shape in (row("", "red"), turned):
        assert SlotGrammar(kit, DockingTable.of(kit), True, "slot_pairs").misfits(built(kit, shape)) == []


def test_round_parts_with_too_many_images_are_seen_from_all_sides_all_the_same() -> None:
    drum = trimesh.creation.cylinder(1.0, 1.0, sections=256)
    drum.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0]))
    quarter = 2 * np.pi / 256 * 37

    def around(start: float, angles: list[int]) -> list[Placed]:
        turns = [trimesh.transformations.rotation_matrix(start + 2 * np.pi * step / 256, [0, 1, 0]) for step in angles]
        return [("drum", pose(0, 0, 0)), *(("red", turn @ pose(1.45, 0, 0)) for turn in turns)]

    seen = [0, 40, 90, 131, 170, 215]
    kit = kit_of({**BLOCKS, "drum": drum}, [around(0.0, seen), around(quarter, seen)])
    assert len(kit.types[0].symmetries) >= 512
    grammar = SlotGrammar(kit, DockingTable.of(kit), True, "slot_fillings")
    assert grammar.misfits(built(kit, around(5 * quarter, seen))) == []
    assert 0 in grammar.misfits(built(kit, around(0.0, [0, 40, 90, 131, 170, 200])))


@pytest.mark.parametrize("folder", SHIPPED[:2], ids=lambda folder: folder.name)
def test_levels_are_nested_and_growth_respects_them(folder: Path) -> None:
    observed = shipped_kit(folder)
    grammars = [SlotGrammar(observed, DockingTable.of(observed), True, level) for level in SLOT_LEVELS]
    for grammar in grammars:
        assert all(grammar.misfits(exemplar.assembly) == [] for exemplar in observed.exemplars)
        assert grammar.observed_share(observed.exemplars[0].assembly) == 1.0
    for place, level in enumerate(SLOT_LEVELS):
        kit = replace(observed, grammar=replace(observed.grammar, strictness=level))
        line = Search(ContactOracle(kit), SearchConfig(method="growth"))
        found, _ = line.run(np.random.default_rng(4), 4000, 4, "test", lambda count: None)
        assert found
        for variant in found[:4]:
            for looser in grammars[place:]:
                assert looser.misfits(variant.assembly) == []
            for part, near in enumerate(variant.assembly.neighbours()):
                assert admits(kit.grammar, int(variant.assembly.types[part]), variant.assembly.multiset(near))


def test_exchange_keeps_to_slots_too() -> None:
    observed = shipped_kit(next(kit for kit in SHIPPED if kit.name == "castle"))
    kit = replace(observed, grammar=replace(observed.grammar, strictness="slot_fillings"))
    line = Search(ContactOracle(kit), SearchConfig(method="exchange"))
    found, _ = line.run(np.random.default_rng(4), 1500, 20, "test", lambda count: None)
    assert found
    assert all(SlotGrammar(kit, DockingTable.of(kit), True).misfits(variant.assembly) == [] for variant in found)
