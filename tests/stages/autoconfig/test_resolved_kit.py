"""Which parts models are taken to have: others are tried where nothing comes of those that `auto` took."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from pipeline.errors import ConfigError
from stages.autoconfig import resolved_kit
from stages.autoconfig.resolve import Resolution
from stages.autoconfig.resolved_kit import ResolvedKit, use_sections_if_empty
from stages.autoconfig.trial_search import TrialResult
from stages.exemplars.identify import identify_parts
from stages.exemplars.model import Model
from stages.exemplars.settings import STRICTEST, ContactConfig, KitConfig, ReadLimits
from stages.shape.kit import Kit
from tests.toy_kits.chains_and_rings import CHAIN, Placed, chain, models_of

LUMP: list[Placed] = chain(2)[1:2]


def told(graphs: int, enough: bool, **values: Any) -> Resolution:
    said = {"up": "z", **values}
    reasons = dict.fromkeys(said, "so it is")
    return Resolution(said, reasons, TrialResult(100, graphs, graphs, 0.1, 0.1), 1.0, enough, 1)


def read_first(graphs: int = 0, segmentation: Any = "components", parts: Any = "auto", **stated: Any) -> ResolvedKit:
    """What `auto` made of a model, and how many graphs a search found in it."""
    config = KitConfig(name="toy", shapes=(Path(__file__),), parts=parts, **stated)
    models = [replace(each, segmentation=segmentation) for each in models_of(CHAIN, [LUMP])]
    return ResolvedKit(config, models, identify_parts(models, config), told(graphs, False))


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[KitConfig]:
    """The configs that a model is cut and searched with: sections make a chain of it, in which enough is found."""
    configs: list[KitConfig] = []

    def choose(config: KitConfig, *_: Any) -> Resolution:
        configs.append(config)
        return told(90, True)

    def read(_: Path, segmentation: str, __: ReadLimits) -> Model:
        assert segmentation == "sections"
        return models_of(CHAIN, [chain(5)])[0]

    monkeypatch.setattr(resolved_kit, "choose", choose)
    monkeypatch.setattr(resolved_kit, "read_model", read)
    return configs


def cut(first: ResolvedKit, require: Sequence[str] = ()) -> ResolvedKit:
    return use_sections_if_empty(first, ReadLimits(), 100, require)


def test_a_mesh_of_which_nothing_comes_is_cut_by_sections_and_searched_by_the_strictest_rules(
    asked: list[KitConfig],
) -> None:
    found = cut(read_first(contact=ContactConfig(kinds=("face",))))
    assert (found.config.parts, len(found.models[0].parts)) == ("sections", 7)
    assert found.choices.values == {"parts": "sections", "grammar": "multiset", "hubs.types": "none", "up": "z"}
    assert found.choices.reasons["parts"] == "cut across: nothing comes of 1 components"
    assert (asked[0].grammar, asked[0].contact.kinds, asked[0].up) == (STRICTEST["grammar"], ("face",), "auto")


@pytest.mark.parametrize(
    "changed", [{"graphs": 1}, {"segmentation": "nodes"}, {"segmentation": "objects"}, {"parts": "components"}]
)
def test_what_gives_something_or_was_meant_is_not_cut(asked: list[KitConfig], changed: dict[str, Any]) -> None:
    first = read_first(**changed)
    assert cut(first) is first
    assert not asked


def test_a_cut_that_repeats_nothing_is_not_searched(asked: list[KitConfig], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(resolved_kit, "read_model", lambda *_: models_of(CHAIN, [chain(1)[:2]])[0])
    first = read_first()
    assert cut(first) is first
    assert not asked


def test_a_cut_that_cannot_be_made_or_gives_too_little_changes_nothing(
    asked: list[KitConfig], monkeypatch: pytest.MonkeyPatch
) -> None:
    first = read_first()
    monkeypatch.setattr(resolved_kit, "choose", lambda *_: told(0, False))
    assert cut(first) is first

    def refuse(*_: Any) -> Model:
        raise ConfigError("too much")

    monkeypatch.setattr(resolved_kit, "read_model", refuse)
    assert cut(first) is first


@pytest.mark.parametrize("poor", [True, False])
def test_under_looser_rules_a_longer_search_says_whether_a_cut_is_a_dataset(
    asked: list[KitConfig], monkeypatch: pytest.MonkeyPatch, poor: bool
) -> None:
    loose = {key: STRICTEST[key] for key in read_first().config.auto_keys()} | {"grammar": "slots", "up": "z"}
    known: list[int] = []

    def choose(config: KitConfig, *_: Any) -> Resolution:
        return told(2, False, **loose) if config.grammar == "auto" else told(0, False)

    def forecast(kit: Kit, _: Any, __: int, graphs: int, **___: Any) -> Any:
        assert kit.grammar.strictness == "slots"
        known.append(graphs)
        return SimpleNamespace(is_poor=poor)

    monkeypatch.setattr(resolved_kit, "choose", choose)
    monkeypatch.setattr(resolved_kit, "estimate_yield", forecast)
    first = read_first()
    found = cut(first)
    assert known == [2]
    if poor:
        assert found is first
    else:
        assert found.choices.values == {"parts": "sections", **loose}
        assert found.choices.reasons["grammar"] == "so it is"


def test_what_a_run_builds_is_built_once_for_the_same_values() -> None:
    first = read_first()
    values = {key: STRICTEST[key] for key in first.config.auto_keys()}
    built = first.observe(values)
    assert first.observe(dict(values)) is built
    assert first.observe({**values, "up": "z"}) is not built
