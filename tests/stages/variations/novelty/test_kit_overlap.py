"""What exemplars share, and a proof where they cannot meet."""

from __future__ import annotations

from stages.variations.novelty.kit_overlap import kit_overlap, overlap_sentence
from tests.stages.variations.search.test_search import search
from tests.toy_kits.chains_and_rings import CHAIN, box, chain, kit_of, pose, with_arrow


def test_kit_of_one_exemplar_has_no_overlap() -> None:
    assert kit_overlap(kit_of(CHAIN, [chain(3)])) == {}


def test_chains_share_inner_neighbourhoods() -> None:
    found = kit_overlap(kit_of(CHAIN, [chain(3), chain(5)]))
    # The cap next to a link, a link next to a cap and a link, a link between links.
    assert (found["types"], found["neighbourhoods"], found["all_neighbourhoods"]) == (2, 3, 3)
    assert found["joints"] == 0
    assert found["mixable"]


def test_exemplars_without_shared_neighbourhood_are_not_mixable() -> None:
    meshes = {**CHAIN, "stone": with_arrow(box(1.0, 0.5, 0.8)), "end": box(0.3, 1.0, 0.9)}
    stones = [("end", pose(-0.65, 0, 0)), *(("stone", pose(x, 0, 0)) for x in range(3)), ("cap", pose(2.75, 0, 0))]
    kit = kit_of(meshes, [chain(3), stones])
    found = kit_overlap(kit)
    assert (found["types"], found["neighbourhoods"], found["joints"], found["mixable"]) == (1, 0, 0, False)
    assert "no variant can show both" in overlap_sentence(found, "multiset", {})
    assert "no variant" not in overlap_sentence(found, "count_and_pairs", {})
    _, variants = search(kit, tries=2000)
    assert variants
    assert all(len(set(variant.origins.tolist())) == 1 for variant in variants)


def test_overlap_sentence_lists_most_frequent_outcomes_first() -> None:
    words = overlap_sentence(
        kit_overlap(kit_of(CHAIN, [chain(3), chain(5)])), "multiset", {"new": 2, "not matched": 30}
    )
    assert words.endswith("32 tries across them: 30 not matched, 2 new")
