"""How the methods of a trial search share the variants that are wanted."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from stages.autoconfig.trial_search import TrialSearch
from stages.shape.geometry.contact_oracle import ContactOracle
from tests.toy_kits.chains_and_rings import CHAIN, ROAD, chain, kit_of, ring


@pytest.mark.parametrize(("evenly", "grown"), [(False, 0), (True, 4)])
def test_methods_find_equal_shares_if_asked_to(evenly: bool, grown: int) -> None:
    """Either method makes many rings of two."""
    search = TrialSearch(ContactOracle(kit_of(ROAD, [ring(3, 5), ring(4, 2)])), np.random.default_rng(1))
    trial = search.run(3000, 8, evenly)
    assert trial.graphs == len(search.variants) == 8
    methods = Counter(variant.lineage["method"] for variant in search.variants)
    assert methods["growth"] == grown
    assert methods["exchange"] == 8 - grown


def test_exemplars_with_other_rows_are_no_hits_and_are_not_found_twice() -> None:
    kit = kit_of(CHAIN, [chain(4)])
    search = TrialSearch(ContactOracle(kit), np.random.default_rng(1))
    found = search.run(400, 2, evenly=True)
    others = search.other_rows(np.random.default_rng(2), 100)
    assert [variant.lineage["method"] for variant in others] == ["rows"] * len(others)
    lengths = [len(variant.assembly) for variant in [*search.variants, *others]]
    assert set(range(4, 11)) - {6} <= set(lengths), "chains of 2 to 8 links, the exemplar's 4 aside"
    assert len(set(lengths)) == len(lengths)
    assert search.result().graphs == found.graphs == 2
