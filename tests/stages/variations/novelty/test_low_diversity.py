"""What makes a pool dull, and what is said of it."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from stages.shape.kit import Kit, Strictness
from stages.variations.novelty.low_diversity import low_diversity, mutual_distance
from tests.toy_kits.chains_and_rings import CHAIN, chain, kit_of

LIVELY = {"variants": 200, "copied": 0.6, "distance": 0.2, "apart": 0.3}


@cache
def one_chain() -> Kit:
    return kit_of(CHAIN, [chain(3)], kinds=("line", "face"))


def test_shapes_are_as_far_apart_as_their_parts_lists() -> None:
    # One part of nine differs, six of ten, and seven of nine.
    counts = np.array([[4, 1], [4, 0], [1, 4]], dtype=np.int32)
    assert np.isclose(mutual_distance(counts), np.mean([1 / 9, 6 / 10, 7 / 9]))
    assert mutual_distance(np.repeat(counts[:1], 1000, axis=0)) == 0.0
    assert mutual_distance(counts[:1]) == mutual_distance(counts[:0]) == 0.0


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"copied": 0.93}, "half of the shapes have 93% or more of their parts copied whole"),
        ({"distance": 0.01}, "parts lists are almost those of the exemplars (E 0.010)"),
        ({"apart": 0.04}, "the shapes are alike (E of two 0.040)"),
    ],
)
def test_each_fault_makes_a_pool_dull_and_is_named(changed: dict[str, float], said: str) -> None:
    assert low_diversity(one_chain(), LIVELY) == ""
    assert said in low_diversity(one_chain(), {**LIVELY, **changed})
    assert low_diversity(one_chain(), {**LIVELY, **changed, "variants": 1}) == ""


def test_what_would_help_is_what_the_kit_has_not_done_already() -> None:
    dull = {**LIVELY, "copied": 1.0}
    said = low_diversity(one_chain(), dull)
    for remedy in ("a second model", "grammar: count_and_pairs", "contact.kinds: [face]", "hubs.types: auto"):
        assert remedy in said
    loosest = replace(one_chain().grammar, strictness="count_and_types", hubs=(0,))
    kit = replace(kit_of(CHAIN, [chain(3), chain(5)]), grammar=loosest)
    always = "the same layout in other proportions (proportions.samples_per_kit)"
    assert low_diversity(kit, dull).endswith(f"what would help: one more model of the same parts, or {always}")


@pytest.mark.parametrize(
    ("strictness", "looser"),
    [
        ("multiset", "count_and_pairs"),
        ("count_and_set", "count_and_pairs"),
        ("count_and_pairs", "count_and_types"),
        ("count_and_types", None),
        ("slot_pairs", "slot_fillings"),
        ("slot_fillings", "slots"),
        ("slots", None),
    ],
)
def test_a_looser_grammar_would_help_where_there_is_one_of_its_kind(strictness: Strictness, looser: str | None) -> None:
    kit = one_chain()
    said = low_diversity(replace(kit, grammar=replace(kit.grammar, strictness=strictness)), {**LIVELY, "copied": 1.0})
    assert said.startswith("dull: ")
    assert ("a looser grammar" in said) == (looser is not None)
    assert looser is None or f"(grammar: {looser})" in said
