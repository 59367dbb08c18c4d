"""The search admits a neighbourhood exactly where the grammar does, whatever it was asked before."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stages.shape.graphs.neighbourhoods import STRICTNESS, admits
from stages.shape.kit import Grammar, Kit, Multiset
from stages.variations.kernels.membership import admitted
from stages.variations.kernels.tables import kit_tables
from tests.stages.variations.search.test_search import SHIPPED, shipped_kit
from tests.toy_kits.chains_and_rings import CHAIN, ROAD, chain, kit_of, ring


@cache
def toy_kits() -> tuple[Kit, Kit]:
    return kit_of(CHAIN, [chain(3), chain(5)]), kit_of(ROAD, [ring(1, 1), ring(2, 3)])


def multiset(types: list[int]) -> Multiset:
    return tuple((entry, types.count(entry)) for entry in sorted(set(types)))


def asked(kit: Kit, cases: list[tuple[int, list[int]]]) -> list[bool]:
    tables = kit_tables(kit, upright=True)
    return [bool(admitted(tables, part_type, np.array([*near, 0]), len(near))) for part_type, near in cases]


around = st.lists(st.integers(0, 1), max_size=4)


@settings(deadline=None, max_examples=60)
@given(
    st.integers(0, 1),
    st.dictionaries(st.integers(0, 1), st.lists(around.map(multiset), min_size=1, max_size=4), min_size=1),
    st.lists(st.tuples(st.integers(0, 1), around), min_size=1, max_size=30),
)
def test_every_strictness_level_follows_its_rule(
    which: int, observed: dict[int, list[Multiset]], cases: list[tuple[int, list[int]]]
) -> None:
    kit = toy_kits()[which]
    for strictness in STRICTNESS:
        neighbourhoods = {part_type: dict.fromkeys(seen, 1) for part_type, seen in observed.items()}
        grammar = Grammar(neighbourhoods, kit.grammar.dockings, {}, strictness)
        expected = [admits(grammar, part_type, multiset(near)) for part_type, near in cases]
        # Asked twice, so that the second time it is remembered.
        assert asked(replace(kit, grammar=grammar), [*cases, *cases]) == [*expected, *expected]


@pytest.mark.parametrize("folder", SHIPPED, ids=lambda folder: folder.name)
def test_compiled_rule_agrees_with_the_grammar(folder: Path) -> None:
    kit = shipped_kit(folder)
    rng = np.random.default_rng(0)
    cases = []
    for part_type, observed in kit.grammar.neighbourhoods.items():
        for seen in observed:
            near = [other for other, count in seen for _ in range(count)]
            changed = near.copy()
            changed[int(rng.random() * len(near))] = int(rng.random() * len(kit.types))
            cases += [(part_type, near), (part_type, changed), (part_type, near[1:])]
    inner = np.zeros(len(cases), dtype=bool)
    for strictness in STRICTNESS:
        grammar = replace(kit.grammar, strictness=strictness)
        found = asked(replace(kit, grammar=grammar), cases)
        assert found == [admits(grammar, part_type, multiset(near)) for part_type, near in cases]
        assert (inner <= np.array(found)).all()
        inner = np.array(found)
