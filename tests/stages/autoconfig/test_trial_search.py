"""How the methods of a trial search share the variants that are wanted."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from stages.autoconfig.trial_search import TrialSearch
from stages.shape.geometry.contact_oracle import ContactOracle
from tests.toy_kits.chains_and_rings import ROAD, kit_of, ring


@pytest.mark.parametrize(("evenly", "grown"), [(False, 0), (True, 4)])
def test_methods_find_equal_shares_if_asked_to(evenly: bool, grown: int) -> None:
    """Either method makes many rings of two."""
    search = TrialSearch(ContactOracle(kit_of(ROAD, [ring(3, 5), ring(4, 2)])), np.random.default_rng(1))
    trial = search.run(3000, 8, evenly)
    assert trial.graphs == len(search.variants) == 8
    methods = Counter(variant.lineage["method"] for variant in search.variants)
    assert methods["growth"] == grown
    assert methods["exchange"] == 8 - grown
