"""What a probe finds by which method."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from stages.autoconfig.trial_search import TrialSearch
from stages.shape.geometry.contact_oracle import ContactOracle
from tests.toy_kits.chains_and_rings import ROAD, kit_of, ring


@pytest.mark.parametrize(("evenly", "grown"), [(False, 0), (True, 4)])
def test_methods_share_what_is_wanted_where_it_is_asked_for(evenly: bool, grown: int) -> None:
    """Many rings can be made of two, by either method."""
    probe = TrialSearch(ContactOracle(kit_of(ROAD, [ring(3, 5), ring(4, 2)])), np.random.default_rng(1))
    finds = probe.go_on(3000, 8, evenly)
    assert finds.graphs == len(probe.variants) == 8
    methods = Counter(each.lineage["method"] for each in probe.variants)
    assert methods["growth"] == grown
    assert methods["exchange"] == 8 - grown
