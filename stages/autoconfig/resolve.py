"""Resolve the keys of a kit that are left at `auto`, each with its reason."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from stages.autoconfig.contact_analysis import ContactAnalysis, Setting, resolve_contact_tolerance
from stages.autoconfig.setting_search import (
    CANDIDATE_GRAMMARS,
    CANDIDATE_KINDS,
    MIN_KEPT_SHARE,
    SUFFICIENT_GRAPHS,
    CandidateSetting,
    SearchSpace,
    parts_without_hubs,
    search_settings,
)
from stages.autoconfig.trial_search import MIN_NON_COPY_RATE, TrialResult, has_low_diversity
from stages.autoconfig.up_axis import resolve_up_axis
from stages.exemplars.diagnostics import listed_names
from stages.exemplars.hubs import hub_types
from stages.exemplars.identify import IdentifiedParts
from stages.exemplars.model import Model
from stages.exemplars.settings import STRICTEST, KitConfig
from stages.shape.graphs.neighbourhoods import SLOT_LEVELS, STRICTNESS
from stages.shape.kit import Assembly, Kit
from stages.shape.physics.judge import unmet_requirement
from stages.shape.physics.settings import Requirements
from stages.shape.resolved_settings import KEEP_TYPES_KEY, MAX_COPIED_SHARE_KEY, REQUIRED_LABELS_KEY, STABLE_KEY
from stages.shape.shape import kit_shape
from stages.variations.novelty.low_diversity import NEAR_COPY_SHARE
from stages.variations.requirements.identity import common_labels
from stages.variations.requirements.required_labels import spanning_labels


@dataclass(frozen=True)
class Resolution:
    """The resolved settings of a kit.

    values: by AUTO_KEYS and REQUIREMENT_KEYS, of the keys that the config leaves at `auto`.
    reasons: a sentence for each value.
    trial: result of the trial search under the resolved settings; None if there was nothing to search.
    kept_share: share of the parts that stay in the shape graphs.
    is_sufficient: whether the trial promises a pool of some size and diversity.
    settings_tried: number of settings that were tried.
    """

    values: Mapping[str, Any]
    reasons: Mapping[str, str]
    trial: TrialResult | None
    kept_share: float
    is_sufficient: bool
    settings_tried: int

    def as_json(self) -> dict[str, Any]:
        """Return it for the record, and for the stage that builds the kit."""
        values = {key: list(value) if isinstance(value, tuple) else value for key, value in self.values.items()}
        return {
            "resolved": values,
            "reasons": dict(self.reasons),
            "trial": None if self.trial is None else {**self.trial.as_json(), "rejects": dict(self.trial.rejects)},
            "kept_share": round(self.kept_share, 4),
            "is_sufficient": self.is_sufficient,
            "settings_tried": self.settings_tried,
        }


REQUIREMENT_KEYS = (MAX_COPIED_SHARE_KEY, STABLE_KEY, REQUIRED_LABELS_KEY, KEEP_TYPES_KEY)


def resolve_settings(
    config: KitConfig,
    models: Sequence[Model],
    identified: IdentifiedParts,
    tries: int,
    require: Sequence[str] = REQUIREMENT_KEYS,
    analyses: dict[Any, ContactAnalysis] | None = None,
) -> Resolution:
    """Resolve what `config` leaves at `auto` for a kit of `models`, whose parts are `identified`.

    Resolved in this order: the up axis; the contact tolerance; kinds of contact, grammar and hubs by a setting search;
    and those of REQUIREMENT_KEYS that are in `require`. A trial search has `tries`, or a multiple. Randomness depends
    on the models and on the stated keys only, so every run and `make inspect` resolve alike.
    analyses: those of earlier calls for the same parts, which remember what they tried; the new one is added
    Raises ConfigError for stated hubs that are no types.
    """
    auto_keys = config.auto_keys()
    values, reasons, stated, analysis = resolve_contacts(config, models, identified, analyses)
    one_surface = any(model.is_cut for model in models)
    space = replace(_search_space(stated, analysis, auto_keys, one_surface), keeps_types=KEEP_TYPES_KEY in require)
    candidates = search_settings(analysis, space, tries)
    for key, (value, reason) in _requirements(analysis, candidates).items():
        if key in require:
            values[key], reasons[key] = value, reason
    if not candidates:
        return Resolution(values, reasons, None, 1.0, False, 0)
    chosen = candidates[-1]
    setting = chosen.setting
    hubs = tuple(analysis.types[index].name for index in setting.hubs)
    bare = sum(int((~np.isin(assembly.types, setting.hubs)).sum()) for assembly in analysis.counted(setting))
    dropped = bare - sum(map(len, analysis.kept_parts(setting)))
    searched = {
        "contact.kinds": setting.kinds,
        "grammar": setting.grammar,
        "hubs.types": hubs or "none",
        "disconnected": "largest" if dropped else "error",
    }
    for key, value in searched.items():
        if key in auto_keys:
            values[key], reasons[key] = value, _reason(key, chosen, candidates)
    if "hubs.types" in auto_keys and one_surface:
        reasons["hubs.types"] = "the parts are pieces of one surface; leaving one out would leave a hole"
    elif "hubs.types" in auto_keys and not chosen.is_sufficient and not hubs:
        reasons["hubs.types"] = _kept_hub_reason(analysis) or reasons["hubs.types"]
    if "disconnected" in auto_keys:
        parts = "1 part is" if dropped == 1 else f"{dropped} parts are"
        reasons["disconnected"] = f"{parts} apart from the largest piece" if dropped else "no part is apart"
    return Resolution(values, reasons, chosen.trial, chosen.kept_share, chosen.is_sufficient, len(candidates))


class ResolvedContacts(NamedTuple):
    """What is known of a kit before any search.

    values, reasons: of the keys at `auto`, as in `Resolution`; only up axis and contact tolerance are resolved.
    config: the kit's config with these values.
    analysis: the contacts of the parts.
    """

    values: dict[str, Any]
    reasons: dict[str, str]
    config: KitConfig
    analysis: ContactAnalysis


def resolve_contacts(
    config: KitConfig,
    models: Sequence[Model],
    identified: IdentifiedParts,
    analyses: dict[Any, ContactAnalysis] | None = None,
) -> ResolvedContacts:
    """Resolve the up axis and the contact tolerance of a kit, and find the contacts of its parts.

    analyses: as of `resolve_settings`
    """
    auto_keys = config.auto_keys()
    values: dict[str, Any] = {key: STRICTEST[key] for key in auto_keys}
    reasons = dict.fromkeys(auto_keys, "the default")
    if "up" in auto_keys:
        values["up"], reasons["up"] = resolve_up_axis(models, identified)
    if "contact.tolerance" in auto_keys:
        tolerance = resolve_contact_tolerance(identified, STRICTEST["contact.tolerance"])
        values["contact.tolerance"], reasons["contact.tolerance"] = tolerance
    stated = config.resolve(values)
    fit_tolerance = config.fit_tolerance if config.types == "meaning" else None
    settings = stated.resolved()
    analysed = settings.tolerance, config.pose_tolerance, settings.up, fit_tolerance
    analyses = {} if analyses is None else analyses
    if analysed not in analyses:
        analyses[analysed] = ContactAnalysis(identified, *analysed)
    return ResolvedContacts(values, reasons, stated, analyses[analysed])


def resolve_max_copied(trial: TrialResult | None) -> tuple[float, str]:
    """Return the largest share of a variant that may be copied, and why: near copies are rejected if a trial search
    finds enough other hits."""
    if trial is None or trial.graphs < SUFFICIENT_GRAPHS:
        return 1.0, "a short search finds too little to reject any of it"
    if trial.by_meaning:
        return 1.0, "a part that replaces another leaves all other parts in place"
    if trial.non_copy_rate < MIN_NON_COPY_RATE:
        return 1.0, f"only {trial.non_copy_rate:.0%} of the hits of a short search are no near copies"
    reason = f"rejects near copies; {trial.non_copy_rate:.0%} of the hits of a short search are more than that"
    return NEAR_COPY_SHARE, reason


def _requirements(analysis: ContactAnalysis, candidates: Sequence[CandidateSetting]) -> dict[str, tuple[Any, str]]:
    """Return value and reason of each of REQUIREMENT_KEYS, under the chosen candidate, the last."""
    if not candidates:
        nothing = "there is nothing to search"
        return {
            MAX_COPIED_SHARE_KEY: resolve_max_copied(None),
            STABLE_KEY: (False, nothing),
            REQUIRED_LABELS_KEY: ((), nothing),
            KEEP_TYPES_KEY: ((), nothing),
        }
    kit, chosen = analysis.kit(candidates[-1].setting), candidates[-1]
    labels = spanning_labels(kit)
    large, none = "the exemplars have parts of these as large as themselves", "no part is as large as an exemplar"
    return {
        MAX_COPIED_SHARE_KEY: resolve_max_copied(chosen.trial),
        STABLE_KEY: resolve_stable(kit, chosen.most_different),
        REQUIRED_LABELS_KEY: (labels, large if labels else none),
        KEEP_TYPES_KEY: resolve_keep_types(kit, chosen.trial),
    }


def resolve_keep_types(kit: Kit, trial: TrialResult) -> tuple[tuple[str, ...], str]:
    """Return the labels that every variant keeps, and why: those of every exemplar that a trial search can keep."""
    common = common_labels(kit)
    if not common:
        return (), "no part type occurs in every exemplar"
    kept = tuple(label for label in common if label not in trial.lost_labels)
    if not trial.lost_labels:
        where = "the exemplar" if len(kit.exemplars) == 1 else "every exemplar"
        return kept, f"all {len(kept)} part types of {where} occur in every variant, in about their shares"
    return kept, f"next to nothing is found that keeps {listed_names(trial.lost_labels)} too"


def resolve_stable(kit: Kit, most_different: Sequence[Assembly]) -> tuple[bool, str]:
    """Return whether unstable shapes are rejected, and why: if the exemplars are stable, and some of the most different
    hits of a trial search are not, but enough are."""
    required = Requirements(stable=True)
    if any(unmet_requirement(required, kit_shape(kit, exemplar.whole)) for exemplar in kit.exemplars):
        return False, "not even the exemplars are stable"
    if not most_different:
        return False, "a short search finds nothing that could fall"
    falling = sum(unmet_requirement(required, kit_shape(kit, assembly)) is not None for assembly in most_different)
    hits = f"of the {len(most_different)} most different hits of a short search"
    if not falling:
        return False, f"none {hits} falls"
    if len(most_different) - falling < MIN_NON_COPY_RATE * len(most_different):
        return False, f"{falling} {hits} fall, so that too few would be left"
    return True, f"{falling} {hits} fall, and the exemplars are stable"


def trial_text(trial: TrialResult) -> str:
    """Return what a trial search found, in words."""
    return trial.text + (", much alike" if trial.graphs and has_low_diversity(trial) else "")


def _search_space(
    stated: KitConfig, analysis: ContactAnalysis, auto_keys: Sequence[str], one_surface: bool
) -> SearchSpace:
    """Return the candidates of the search: a single value of each key that the config states.

    Hubs are left out because shapes hold together without them; those that fit are restored. Pieces of one surface are
    no such parts: a missing piece is a hole. By meaning, only labels restrict neighbours, so every neighbourhood must
    have been observed: under looser rules a chair has one leg.
    """
    settings = stated.resolved()
    searches_hubs = "hubs.types" in auto_keys and stated.types != "meaning" and not one_surface
    searches_grammars = "grammar" in auto_keys and stated.types != "meaning"
    return SearchSpace(
        kinds=CANDIDATE_KINDS if "contact.kinds" in auto_keys else (settings.kinds,),
        grammars=CANDIDATE_GRAMMARS if searches_grammars else (settings.grammar,),
        hubs=None if searches_hubs else hub_types(stated, analysis.types),
        may_drop_pieces="disconnected" in auto_keys or settings.disconnected == "largest",
    )


def _kept_hub_reason(analysis: ContactAnalysis) -> str:
    """Say that the model falls apart without the most connected hub; empty if it does not."""
    hub = analysis.most_connected_type(())
    kept = analysis.part_count if hub is None else parts_without_hubs(analysis, (hub,))
    if hub is None or kept >= MIN_KEPT_SHARE * analysis.part_count:
        return ""
    name = analysis.types[hub].name
    return f"the model falls apart without {name}: {kept} of {analysis.part_count} parts stay in one piece"


def _reason(key: str, chosen: CandidateSetting, candidates: Sequence[CandidateSetting]) -> str:
    """Say why the search ended at this value of a key: its hits, and those one step stricter in this key alone."""
    setting = chosen.setting
    stricter: list[Setting] = []
    if key == "contact.kinds":
        stricter = [replace(setting, kinds=kinds) for kinds in CANDIDATE_KINDS if len(kinds) > len(setting.kinds)]
    elif key == "grammar":
        levels = (*STRICTNESS, *SLOT_LEVELS)
        stricter = [replace(setting, grammar=level) for level in levels[: levels.index(setting.grammar)]]
    elif key == "hubs.types" and setting.hubs:
        stricter = [replace(setting, hubs=())]
    for other in reversed(stricter):
        candidate = next((candidate for candidate in candidates if candidate.setting == other), None)
        if candidate is not None:
            lost = [label for label in candidate.trial.lost_labels if label not in chosen.trial.lost_labels]
            losses = f", which seldom keep {listed_names(lost)}" if lost else ""
            return f"{trial_text(chosen.trial)}; the next stricter: {trial_text(candidate.trial)}{losses}"
    if chosen.is_sufficient:
        return "the strictest, and it finds enough"
    if not chosen.trial.graphs:
        return f"no setting finds anything in {chosen.trial.tries:,} tries"
    return f"nothing else finds more than {trial_text(chosen.trial)}"
