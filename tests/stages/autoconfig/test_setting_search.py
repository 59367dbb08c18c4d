"""Which candidate settings are tried."""

from __future__ import annotations

from typing import Any

import pytest

from stages.autoconfig import setting_search
from stages.autoconfig.contact_analysis import ContactAnalysis, Setting
from stages.autoconfig.setting_search import CANDIDATE_GRAMMARS, CandidateSetting, SearchSpace, search_settings
from stages.autoconfig.trial_search import TrialResult
from stages.exemplars.identify import identify_parts
from tests.toy_kits.chains_and_rings import CHAIN, box, chain, config_of, models_of, pose


@pytest.mark.parametrize(
    ("histograms", "expected"),
    [(9, ["multiset", "count_and_pairs", "slots"]), (10, list(CANDIDATE_GRAMMARS))],
)
def test_stricter_slots_are_tried_only_if_the_loosest_find_something(
    histograms: int, expected: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The loosest level of slots admits whatever a stricter one admits."""
    tried: list[str] = []

    def try_setting(_: Any, setting: Setting, *__: Any) -> CandidateSetting:
        tried.append(setting.grammar)
        count = histograms if setting.grammar == "slots" else 0
        return CandidateSetting(setting, TrialResult(100, count, count, 0.1, 0.1), 1.0)

    monkeypatch.setattr(setting_search, "_try_setting", try_setting)
    shape = chain(3)
    analysis = ContactAnalysis(identify_parts(models_of(CHAIN, [shape]), config_of([shape])), 1e-3, 1e-2, "y")
    candidates = search_settings(analysis, SearchSpace(kinds=(("face",),), hubs=()), 100)
    assert sorted(tried) == sorted(expected)  # once each
    assert {candidate.setting.grammar for candidate in candidates} == set(expected)
    assert candidates[-1].setting.grammar == "slots"


@pytest.mark.parametrize(
    ("sufficient", "lost", "expected"),
    [
        ({"count_and_pairs"}, (), ["multiset", "count_and_set", "count_and_pairs"]),
        ({"count_and_set", "count_and_pairs"}, (), ["multiset", "count_and_pairs", "count_and_set"]),
        ({"count_and_set", "count_and_pairs"}, ("door",), ["multiset", "count_and_set", "count_and_pairs"]),
        ({"multiset", "count_and_set", "count_and_pairs"}, (), ["multiset"]),
    ],
)
def test_grammar_between_two_candidates_is_taken_where_it_suffices_too(
    sufficient: set[str], lost: tuple[str, ...], expected: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """But not where variants lose part types that the looser grammar keeps."""

    def try_setting(_: Any, setting: Setting, *__: Any) -> CandidateSetting:
        count = 100 if setting.grammar in sufficient else 0
        labels = lost if setting.grammar == "count_and_set" else ()
        found = TrialResult(100, count, count, 0.1, 0.1, copied_share=0.5, lost_labels=labels)
        return CandidateSetting(setting, found, 1.0)

    monkeypatch.setattr(setting_search, "_try_setting", try_setting)
    shape = chain(3)
    analysis = ContactAnalysis(identify_parts(models_of(CHAIN, [shape]), config_of([shape])), 1e-3, 1e-2, "y")
    candidates = search_settings(analysis, SearchSpace(kinds=(("face",),), hubs=()), 100)
    assert [candidate.setting.grammar for candidate in candidates] == expected, "the chosen one last"
    assert candidates[-1].is_sufficient


def test_fewer_kinds_of_contact_are_tried_before_a_looser_grammar(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tiles of a race track touch in points, too; a looser grammar takes a point for the corner that leads on."""

    def try_setting(_: Any, setting: Setting, *__: Any) -> CandidateSetting:
        suffices = setting.kinds == ("face",) or setting.grammar != "multiset"
        count = 100 if suffices else 0
        return CandidateSetting(setting, TrialResult(100, count, count, 0.1, 0.1, copied_share=0.5), 1.0)

    monkeypatch.setattr(setting_search, "_try_setting", try_setting)
    bend = [("tile", pose(x, 0.0, z)) for x, z in ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0))]
    parts = identify_parts(models_of({"tile": box(1.0, 0.2, 1.0)}, [bend]), config_of([bend]))
    analysis = ContactAnalysis(parts, 1e-3, 1e-2, "y")
    assert analysis.kinds == ("line", "face")
    chosen = search_settings(analysis, SearchSpace(hubs=()), 100)[-1].setting
    assert (chosen.kinds, chosen.grammar) == (("face",), "multiset")
