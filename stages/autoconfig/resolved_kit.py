"""Models read and decided upon: by the parts that the config or `auto` takes, or by sections where nothing comes of
those."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from pipeline.errors import ConfigError
from stages.autoconfig.resolve import Resolution, resolve_settings
from stages.autoconfig.yield_estimate import estimate_yield
from stages.exemplars.build import Observation, observe_parts
from stages.exemplars.identify import IdentifiedParts, identify_parts
from stages.exemplars.model import Model
from stages.exemplars.read import read_model
from stages.exemplars.settings import STRICTEST, KitConfig, ReadLimits
from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.resolved_settings import MAX_COPIED_SHARE_KEY

PARTS_KEY = "parts"
"""What `parts` is called among the keys that are chosen for a kit."""
MIN_PARTS_PER_TYPE = 2.0
"""Cuts are tried where they make so many parts of each type: what repeats can be there once more, or gone."""


@dataclass(frozen=True)
class ResolvedKit:
    """Models with their identified parts, what was chosen for them, and the config that says which parts they have."""

    config: KitConfig
    models: Sequence[Model]
    identified: IdentifiedParts
    choices: Resolution
    _observed: dict[str, Observation] = field(default_factory=dict, compare=False, repr=False)

    def observe(self, values: Mapping[str, Any]) -> Observation:
        """What a run builds of the models where the keys left open come to `values`; built once for the same."""
        config = self.config.resolve(values)
        told = config.model_dump_json()
        if told not in self._observed:
            self._observed[told] = observe_parts(config, self.models, self.identified)
        return self._observed[told]


def read_and_resolve(config: KitConfig, limits: ReadLimits, tries: int, require: Sequence[str]) -> ResolvedKit:
    """Read the models of a kit and decide its auto keys, as `resolve_settings` and `use_sections_if_empty`."""
    models = [read_model(shape.path, config.parts, limits) for shape in config.shapes]
    identified = identify_parts(models, config)
    first = ResolvedKit(config, models, identified, resolve_settings(config, models, identified, tries, require))
    return use_sections_if_empty(first, limits, tries, require)


def use_sections_if_empty(first: ResolvedKit, limits: ReadLimits, tries: int, require: Sequence[str]) -> ResolvedKit:
    """Models cut by sections where `auto` took pieces of meshes for parts and a search found nothing in them, if it
    finds enough then under the strictest rules, or under others what a longer search makes a dataset of: the first find
    of slabs is rare, for all that passes a section must fit at once. Else as they were read first."""
    finds = first.choices.finds
    by_author = any(each.segmentation in ("nodes", "objects") for each in first.models)
    if first.config.parts != "auto" or by_author or finds is None or finds.graphs:
        return first
    config = first.config.model_copy(update={"parts": "sections"})
    try:
        models = [read_model(each.path, config.parts, limits) for each in first.models]
        identified = identify_parts(models, config)
    except ConfigError:
        return first
    if sum(len(each) for each in identified.assemblies) < MIN_PARTS_PER_TYPE * len(identified.types):
        return first
    searched = ("contact.kinds", "grammar", "hubs.types")
    strictest = {key: STRICTEST[key] for key in config.auto_keys() if key in searched}
    choices = resolve_settings(config.resolve(strictest), models, identified, tries, require)
    values = {**strictest, **choices.values}
    reasons = {**dict.fromkeys(strictest, "the strictest, and it gives enough"), **choices.reasons}
    if not choices.enough:
        choices = resolve_settings(config, models, identified, tries, require)
        values, reasons = dict(choices.values), dict(choices.reasons)
        if not _is_dataset(ResolvedKit(config, models, identified, choices), tries):
            return first
    why = f"cut across: nothing comes of {len(first.models[0].parts)} {first.models[0].segmentation}"
    values, reasons = {PARTS_KEY: config.parts, **values}, {PARTS_KEY: why, **reasons}
    return ResolvedKit(config, models, identified, replace(choices, values=values, reasons=reasons))


def _is_dataset(reading: ResolvedKit, tries: int) -> bool:
    """Whether a longer search of what a short one found anything in promises enough that is neither dull nor broken."""
    choices = reading.choices
    if choices.finds is None or not choices.finds.graphs:
        return False
    built = reading.observe(choices.values)
    if built.refusals:
        return False
    copied = choices.values.get(MAX_COPIED_SHARE_KEY, 1.0)
    return not estimate_yield(built.kit, ContactOracle(built.kit), tries, choices.finds.graphs, copied=copied).is_poor
