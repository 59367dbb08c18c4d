"""Which rungs of the ladder are tried."""

from __future__ import annotations

from typing import Any

import pytest

from stages.autoconfig import setting_search
from stages.autoconfig.contact_analysis import ContactAnalysis, Setting
from stages.autoconfig.setting_search import CANDIDATE_GRAMMARS, CandidateSetting, SearchSpace, search_settings
from stages.autoconfig.trial_search import TrialResult
from stages.exemplars.identify import identify_parts
from tests.toy_kits.chains_and_rings import CHAIN, chain, config_of, models_of


@pytest.mark.parametrize(
    ("histograms", "tried"),
    [(9, ["multiset", "count_and_pairs", "slots"]), (10, list(CANDIDATE_GRAMMARS))],
)
def test_stricter_slots_are_tried_only_where_the_loosest_find_something(
    histograms: int, tried: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """All that a stricter level of slots admits, the loosest admits, too."""
    asked: list[str] = []

    def rung(_: Any, setting: Setting, *__: Any) -> CandidateSetting:
        asked.append(setting.grammar)
        found = histograms if setting.grammar == "slots" else 0
        return CandidateSetting(setting, TrialResult(100, found, found, 0.1, 0.1), 1.0)

    monkeypatch.setattr(setting_search, "_rung", rung)
    shape = chain(3)
    sight = ContactAnalysis(identify_parts(models_of(CHAIN, [shape]), config_of([shape])), 1e-3, 1e-2, "y")
    rungs = search_settings(sight, SearchSpace(kinds=(("face",),), hubs=()), 100)
    assert sorted(asked) == sorted(tried)  # each once
    assert {each.setting.grammar for each in rungs} == set(tried)
    assert rungs[-1].setting.grammar == "slots"
