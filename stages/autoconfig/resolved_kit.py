"""Read the models of a kit and resolve its settings; cut meshes into sections if nothing else yields a result."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from pipeline.errors import ConfigError
from stages.autoconfig.contact_analysis import ContactAnalysis
from stages.autoconfig.resolve import Resolution, resolve_settings
from stages.autoconfig.yield_estimate import YieldEstimate, estimate_yield
from stages.exemplars.build import Observation, observe_parts
from stages.exemplars.diagnostics import single_part_refusal
from stages.exemplars.identify import IdentifiedParts, identify_parts
from stages.exemplars.model import Model
from stages.exemplars.read import read_parts
from stages.exemplars.segmentation import NOT_CUT
from stages.exemplars.settings import STRICTEST, KitConfig
from stages.model_files.limits import ReadLimits
from stages.rows.kit_rows import rows_of_kit
from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.kit import Kit
from stages.shape.resolved_settings import KEEP_TYPES_KEY, MAX_COPIED_SHARE_KEY
from stages.variations.requirements.hub_restoration import auto_min_hubs

PARTS_KEY = "parts"
"""The key of `parts` among the resolved settings of a kit."""
MIN_PARTS_PER_TYPE = 2.0
"""Sections are tried if they make this many parts of each type on average: only repeats can be inserted or removed."""


@dataclass(frozen=True)
class ResolvedKit:
    """Models with their identified parts and resolved settings.

    config: the kit's config, which says what makes a part, with its other `auto` keys left open.
    """

    config: KitConfig
    models: Sequence[Model]
    identified: IdentifiedParts
    resolution: Resolution
    _observed: dict[str, Observation] = field(default_factory=dict, compare=False, repr=False)
    _estimates: dict[Any, tuple[Kit, YieldEstimate]] = field(default_factory=dict, compare=False, repr=False)

    def observe(self, values: Mapping[str, Any]) -> Observation:
        """Return what a run builds of the models with these `values` of the `auto` keys; cached by config."""
        config = self.config.resolve(values)
        key = config.model_dump_json()
        if key not in self._observed:
            self._observed[key] = observe_parts(config, self.models, self.identified)
        return self._observed[key]

    def estimate(self, stated: KitConfig, oracle: ContactOracle, tries: int) -> YieldEstimate:
        """Estimate the layouts of the kit of `oracle`, which is built as `stated` with the resolved settings; once."""
        kit = oracle.kit
        known_graphs = self.resolution.trial.graphs if self.resolution.trial is not None else 0
        values = self.resolution.values
        required = {
            "min_hubs": auto_min_hubs(stated, kit),
            "max_copied_share": values.get(MAX_COPIED_SHARE_KEY, 1.0),
            "keep_types": tuple(values.get(KEEP_TYPES_KEY, ())),
        }
        key = id(kit), tries, known_graphs, *required.values()
        if key not in self._estimates:
            self._estimates[key] = kit, estimate_yield(kit, oracle, tries, known_graphs, **required)
        return self._estimates[key][1]


def read_and_resolve(config: KitConfig, limits: ReadLimits, tries: int, require: Sequence[str]) -> ResolvedKit:
    """Read the models of a kit and resolve its `auto` keys, as `resolve_settings` and `use_sections_if_empty` do.

    Raises ConfigError before any search for models of one part that sections cannot cut.
    """
    texture_size = config.appearance.kept_texture_size
    models = [read_parts(shape.path, config.parts, limits, config.units, texture_size) for shape in config.shapes]
    single = [model for model in models if len(model.parts) < 2 and not model.why.endswith(NOT_CUT)]
    if single:
        raise ConfigError("\n".join(map(single_part_refusal, single)))
    return resolve_models(config, models, identify_parts(models, config), limits, tries, require)


def resolve_models(
    config: KitConfig,
    models: Sequence[Model],
    identified: IdentifiedParts,
    limits: ReadLimits,
    tries: int,
    require: Sequence[str],
    analyses: dict[Any, ContactAnalysis] | None = None,
) -> ResolvedKit:
    """Resolve the `auto` keys of a kit of `models`, whose parts are `identified`; models that are cut into sections are
    read again.

    analyses: as of `resolve_settings`
    """
    resolution = resolve_settings(config, models, identified, tries, require, analyses)
    return use_sections_if_empty(ResolvedKit(config, models, identified, resolution), limits, tries, require)


def use_sections_if_empty(first: ResolvedKit, limits: ReadLimits, tries: int, require: Sequence[str]) -> ResolvedKit:
    """Cut the models into sections if `auto` took pieces of meshes for parts, or failed to cut one by its symmetries,
    and a trial search found nothing in them. Pieces that have rows or bays stay, since these become longer and shorter.

    Sections are taken if they yield enough under the strictest rules, or under other rules what a longer search makes
    a dataset of: the first hit of slabs is rare, since all that crosses a section must fit at the same time. Otherwise,
    and where the first hits look like the exemplar, the models stay as they were read first.
    """
    trial = first.resolution.trial
    by_author = any(
        model.segmentation in ("nodes", "objects") and not model.why.endswith(NOT_CUT) for model in first.models
    )
    if first.config.parts != "auto" or by_author or (trial is not None and trial.graphs) or _has_rows(first):
        return first
    config = first.config.model_copy(update={"parts": "sections"})
    try:
        texture_size = config.appearance.kept_texture_size
        models = [read_parts(model.path, config.parts, limits, config.units, texture_size) for model in first.models]
        identified = identify_parts(models, config)
    except ConfigError:
        return first
    if sum(len(assembly) for assembly in identified.assemblies) < MIN_PARTS_PER_TYPE * len(identified.types):
        return first
    searched = ("contact.kinds", "grammar", "hubs.types")
    strictest = {key: STRICTEST[key] for key in config.auto_keys() if key in searched}
    analyses: dict[Any, ContactAnalysis] = {}
    resolution = resolve_settings(config.resolve(strictest), models, identified, tries, require, analyses)
    values = {**strictest, **resolution.values}
    reasons = {**dict.fromkeys(strictest, "the strictest, and it finds enough"), **resolution.reasons}
    if resolution.trial is not None and resolution.trial.looks_like_exemplar:
        return first  # slabs that are inserted and removed are too thin to be seen
    resolved = ResolvedKit(config, models, identified, resolution)
    if not resolution.is_sufficient:
        resolution = resolve_settings(config, models, identified, tries, require, analyses)
        values, reasons = dict(resolution.values), dict(resolution.reasons)
        resolved = replace(resolved, resolution=resolution)
        if not _is_dataset(resolved, tries):
            return first
    reason = f"cut across: nothing comes of {len(first.models[0].parts)} {first.models[0].segmentation}"
    values, reasons = {PARTS_KEY: config.parts, **values}, {PARTS_KEY: reason, **reasons}
    return replace(resolved, resolution=replace(resolution, values=values, reasons=reasons))


def _has_rows(resolved: ResolvedKit) -> bool:
    """Return whether rows or bays of the exemplars can become longer or shorter."""
    strictest = {key: STRICTEST[key] for key in resolved.config.auto_keys()}
    built = resolved.observe({**strictest, **resolved.resolution.values})
    return not built.refusals and not built.kit.one_surface and bool(rows_of_kit(built.kit))


def _is_dataset(resolved: ResolvedKit, tries: int) -> bool:
    """Return whether a longer search promises enough that is neither alike nor broken; False if the trial is empty."""
    resolution = resolved.resolution
    if resolution.trial is None or not resolution.trial.graphs:
        return False
    built = resolved.observe(resolution.values)
    if built.refusals:
        return False
    return not resolved.estimate(resolved.config, ContactOracle(built.kit), tries).is_poor
