"""Models are cut into sections if nothing comes of the parts that `auto` took."""

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
from stages.autoconfig.resolved_kit import ResolvedKit, read_and_resolve, use_sections_if_empty
from stages.autoconfig.trial_search import MIN_MOVED_DISTANCE, TrialResult
from stages.exemplars.identify import identify_parts
from stages.exemplars.model import Model
from stages.exemplars.segmentation import NOT_CUT
from stages.exemplars.settings import STRICTEST, ContactConfig, KitConfig
from stages.model_files.limits import ReadLimits
from stages.shape.kit import Kit
from tests.toy_kits.chains_and_rings import CHAIN, Placed, chain, models_of, write_model

LUMP: list[Placed] = chain(2)[1:2]


def resolution_of(graphs: int, sufficient: bool, **values: Any) -> Resolution:
    values = {"up": "z", **values}
    reasons = dict.fromkeys(values, "a reason")
    return Resolution(values, reasons, TrialResult(100, graphs, graphs, 0.1, 0.1), 1.0, sufficient, 1)


def read_first(graphs: int = 0, segmentation: Any = "components", parts: Any = "auto", **stated: Any) -> ResolvedKit:
    """Return what `auto` made of a model in which a search found some graphs."""
    config = KitConfig(name="toy", shapes=(Path(__file__),), parts=parts, **stated)
    models = [replace(model, segmentation=segmentation) for model in models_of(CHAIN, [LUMP])]
    return ResolvedKit(config, models, identify_parts(models, config), resolution_of(graphs, False))


@pytest.fixture
def searched(monkeypatch: pytest.MonkeyPatch) -> list[KitConfig]:
    """Collect the configs that a model is searched with; sections make a chain of it, in which enough is found."""
    configs: list[KitConfig] = []

    def resolve(config: KitConfig, *_: Any) -> Resolution:
        configs.append(config)
        return resolution_of(90, True)

    def read(_: Path, segmentation: str, *_settings: Any) -> Model:
        assert segmentation == "sections"
        return models_of(CHAIN, [chain(5)])[0]

    monkeypatch.setattr(resolved_kit, "resolve_settings", resolve)
    monkeypatch.setattr(resolved_kit, "read_parts", read)
    return configs


def cut(first: ResolvedKit, require: Sequence[str] = ()) -> ResolvedKit:
    return use_sections_if_empty(first, ReadLimits(), 100, require)


def test_mesh_without_results_is_cut_into_sections_under_the_strictest_rules(
    searched: list[KitConfig],
) -> None:
    resolved = cut(read_first(contact=ContactConfig(kinds=("face",))))
    assert (resolved.config.parts, len(resolved.models[0].parts)) == ("sections", 7)
    assert resolved.resolution.values == {"parts": "sections", "grammar": "multiset", "hubs.types": "none", "up": "z"}
    assert resolved.resolution.reasons["parts"] == "cut across: nothing comes of 1 components"
    assert (searched[0].grammar, searched[0].contact.kinds, searched[0].up) == (STRICTEST["grammar"], ("face",), "auto")


@pytest.mark.parametrize(
    "changed",
    [
        {"graphs": 1},
        {"segmentation": "nodes"},
        {"segmentation": "objects"},
        {"parts": "components"},
    ],
)
def test_parts_with_results_or_by_the_author_are_not_cut(searched: list[KitConfig], changed: dict[str, Any]) -> None:
    first = read_first(**changed)
    assert cut(first) is first


def test_mesh_whose_cut_by_symmetry_failed_is_cut_into_sections(searched: list[KitConfig]) -> None:
    whole = read_first(segmentation="nodes")
    models = [replace(model, why=f"one node, {NOT_CUT}") for model in whole.models]
    nothing_to_search = replace(whole.resolution, trial=None)
    assert cut(replace(whole, models=models, resolution=nothing_to_search)).config.parts == "sections"


def test_sections_without_repeats_are_not_searched(searched: list[KitConfig], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(resolved_kit, "read_parts", lambda *_: models_of(CHAIN, [chain(1)[:2]])[0])
    first = read_first()
    assert cut(first) is first


def test_impossible_or_useless_sections_change_nothing(
    searched: list[KitConfig], monkeypatch: pytest.MonkeyPatch
) -> None:
    first = read_first()
    monkeypatch.setattr(resolved_kit, "resolve_settings", lambda *_: resolution_of(0, False))
    assert cut(first) is first

    def refuse(*_: Any) -> Model:
        raise ConfigError("too much")

    monkeypatch.setattr(resolved_kit, "read_parts", refuse)
    assert cut(first) is first


@pytest.mark.parametrize("poor", [True, False])
def test_under_looser_rules_a_yield_estimate_decides_about_sections(
    searched: list[KitConfig], monkeypatch: pytest.MonkeyPatch, poor: bool
) -> None:
    loose = {key: STRICTEST[key] for key in read_first().config.auto_keys()} | {"grammar": "slots", "up": "z"}
    known: list[int] = []

    def resolve(config: KitConfig, *_: Any) -> Resolution:
        return resolution_of(2, False, **loose) if config.grammar == "auto" else resolution_of(0, False)

    def estimate(kit: Kit, _: Any, __: int, graphs: int, **___: Any) -> Any:
        assert kit.grammar.strictness == "slots"
        known.append(graphs)
        return SimpleNamespace(is_poor=poor)

    monkeypatch.setattr(resolved_kit, "resolve_settings", resolve)
    monkeypatch.setattr(resolved_kit, "estimate_yield", estimate)
    first = read_first()
    resolved = cut(first)
    assert known == [2]
    if poor:
        assert resolved is first
    else:
        assert resolved.resolution.values == {"parts": "sections", **loose}
        assert resolved.resolution.reasons["grammar"] == "a reason"


@pytest.mark.parametrize(("share_of_threshold", "stays_whole"), [(0.75, True), (1.5, False)])
def test_model_stays_whole_where_sections_give_only_variants_that_look_like_it(
    searched: list[KitConfig], monkeypatch: pytest.MonkeyPatch, share_of_threshold: float, stays_whole: bool
) -> None:
    first = read_first()
    alike = resolution_of(90, False)
    assert alike.trial is not None
    trial = replace(alike.trial, distance=0.4, pair_distance=0.3, moved=share_of_threshold * MIN_MOVED_DISTANCE)
    every_key = {key: STRICTEST[key] for key in first.config.auto_keys()} | {"up": "z"}
    under_looser_rules = resolution_of(90, True, **every_key)

    def resolve(config: KitConfig, *_: Any) -> Resolution:
        searched.append(config)
        return under_looser_rules if config.grammar == "auto" else replace(alike, trial=trial)

    monkeypatch.setattr(resolved_kit, "resolve_settings", resolve)
    monkeypatch.setattr(resolved_kit, "estimate_yield", lambda *_, **__: SimpleNamespace(is_poor=False))
    resolved = cut(first)
    assert (resolved is first) is stays_whole
    assert [config.grammar for config in searched] == ["multiset", "auto"][: 1 if stays_whole else 2]


def test_observation_is_cached_by_values() -> None:
    first = read_first()
    values = {key: STRICTEST[key] for key in first.config.auto_keys()}
    built = first.observe(values)
    assert first.observe(dict(values)) is built
    assert first.observe({**values, "up": "z"}) is not built


def test_model_of_one_part_is_refused_before_a_search(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(resolved_kit, "resolve_settings", lambda *_: pytest.fail("searched"))
    lump = write_model(tmp_path / "lump.glb", CHAIN, LUMP)
    config = KitConfig(name="toy", shapes=(Path(lump),), parts="nodes")
    with pytest.raises(ConfigError, match=r"lump\.glb: has 1 part by nodes .*; set `parts: auto`, split .* `grammars`"):
        read_and_resolve(config, ReadLimits(), 10, ())
