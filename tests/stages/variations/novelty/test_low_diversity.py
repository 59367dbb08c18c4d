"""What makes a pool dull, and what is said of it."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from stages.shape.kit import Kit, Strictness
from stages.variations.novelty.low_diversity import low_diversity, mutual_distance
from tests.toy_kits.chains_and_rings import CHAIN, chain, kit_of

LIVELY = {"variants": 200, "copied_share": 0.6, "distance": 0.2, "mutual_distance": 0.3}


@cache
def one_chain() -> Kit:
    return kit_of(CHAIN, [chain(3)], kinds=("line", "face"))


def test_mutual_distance_is_that_of_parts_lists() -> None:
    # One part of nine differs, six of ten, and seven of nine.
    counts = np.array([[4, 1], [4, 0], [1, 4]], dtype=np.int32)
    assert np.isclose(mutual_distance(counts), np.mean([1 / 9, 6 / 10, 7 / 9]))
    assert mutual_distance(np.repeat(counts[:1], 1000, axis=0)) == 0.0
    assert mutual_distance(counts[:1]) == mutual_distance(counts[:0]) == 0.0


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"copied_share": 0.93}, "half of the shapes have 93% or more of their parts in one verbatim piece"),
        ({"distance": 0.01}, "parts lists are almost those of the exemplars (E 0.010)"),
        ({"mutual_distance": 0.04}, "the shapes are alike (E of two 0.040)"),
    ],
)
def test_every_fault_of_a_pool_is_reported(changed: dict[str, float], said: str) -> None:
    assert low_diversity(one_chain(), LIVELY) == ""
    assert said in low_diversity(one_chain(), {**LIVELY, **changed})
    assert low_diversity(one_chain(), {**LIVELY, **changed, "variants": 1}) == ""


def test_remedies_are_new_to_the_kit() -> None:
    poor = {**LIVELY, "copied_share": 1.0}
    said = low_diversity(one_chain(), poor)
    for remedy in ("a second model", "grammar: count_and_pairs", "contact.kinds: [face]", "hubs.types: auto"):
        assert remedy in said
    loosest = replace(one_chain().grammar, strictness="count_and_types", hubs=(0,))
    kit = replace(kit_of(CHAIN, [chain(3), chain(5)]), grammar=loosest)
    always = "the same layout in other proportions (proportions.samples_per_kit)"
    assert low_diversity(kit, poor).endswith(f"what would help: another model of the same parts, or {always}")


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
def test_looser_grammar_is_a_remedy_where_one_exists(strictness: Strictness, looser: str | None) -> None:
    kit = one_chain()
    said = low_diversity(
        replace(kit, grammar=replace(kit.grammar, strictness=strictness)), {**LIVELY, "copied_share": 1.0}
    )
    assert said.startswith("low diversity: ")
    assert ("a looser grammar" in said) == (looser is not None)
    assert looser is None or f"(grammar: {looser})" in said
