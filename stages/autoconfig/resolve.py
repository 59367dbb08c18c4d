"""What the keys of a kit that are left at `auto` come to, and why."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stages.autoconfig.contact_analysis import ContactAnalysis, Setting, resolve_contact_tolerance
from stages.autoconfig.setting_search import (
    CANDIDATE_GRAMMARS,
    CANDIDATE_KINDS,
    MIN_KEPT_SHARE,
    MIN_NON_COPY_RATE,
    SUFFICIENT_GRAPHS,
    CandidateSetting,
    SearchSpace,
    has_low_diversity,
    parts_without_hubs,
    search_settings,
)
from stages.autoconfig.trial_search import TrialResult
from stages.autoconfig.up_axis import resolve_up_axis
from stages.exemplars.hubs import hub_types
from stages.exemplars.identify import IdentifiedParts
from stages.exemplars.model import Model
from stages.exemplars.settings import STRICTEST, KitConfig
from stages.shape.kit import Assembly, Kit
from stages.shape.physics.judge import unmet_requirement
from stages.shape.physics.settings import Requirements
from stages.shape.resolved_settings import MAX_COPIED_SHARE_KEY, REQUIRED_LABELS_KEY, STABLE_KEY
from stages.shape.shape import kit_shape
from stages.variations.novelty.low_diversity import NEAR_COPY_SHARE
from stages.variations.requirements.required_labels import spanning_labels


@dataclass(frozen=True)
class Resolution:
    """What was chosen for a kit.

    values: of the keys that the config left open, by OPEN_KEYS and REQUIREMENTS; reasons: a sentence for each; finds:
    of the probe under what was chosen, None where there was nothing to probe; kept: share of the parts that stay in
    the shape graphs; enough: whether the probe promises a pool of some size that is not dull; settings: how many were
    probed.
    """

    values: Mapping[str, Any]
    reasons: Mapping[str, str]
    finds: TrialResult | None
    kept: float
    enough: bool
    settings: int

    def as_json(self) -> dict[str, Any]:
        """For the record, and for the stage that builds the kit."""
        probe = None
        if self.finds is not None:
            probe = {**self.finds.as_json(), "rejects": dict(self.finds.rejects)}
        return {
            "resolved": {key: list(each) if isinstance(each, tuple) else each for key, each in self.values.items()},
            "reasons": dict(self.reasons),
            "probe": probe,
            "kept": round(self.kept, 4),
            "enough": self.enough,
            "settings": self.settings,
        }


REQUIREMENT_KEYS = (MAX_COPIED_SHARE_KEY, STABLE_KEY, REQUIRED_LABELS_KEY)


def resolve_settings(
    config: KitConfig,
    models: Sequence[Model],
    identified: IdentifiedParts,
    tries: int,
    require: Sequence[str] = REQUIREMENT_KEYS,
) -> Resolution:
    """Decide what `config` leaves open for a kit of `models`, whose parts are `identified`; what it states is obeyed.

    In this order: the axis that points up, the contact tolerance, the first rung of a ladder over kinds of contact,
    grammar and hubs under which a short search, of `tries` or some times as many, finds enough; and what variants must
    be, those of REQUIREMENTS that are in `require`: no near copies, stable, with the carcass of the exemplars. All that
    is random in it depends on the models and on what is stated alone, so every run and `make inspect` choose alike.
    Raises ConfigError for stated hubs that are no types.
    """
    open_keys = config.auto_keys()
    values: dict[str, Any] = {key: STRICTEST[key] for key in open_keys}
    reasons = dict.fromkeys(open_keys, "the default")
    if "up" in open_keys:
        values["up"], reasons["up"] = resolve_up_axis(models, identified)
    if "contact.tolerance" in open_keys:
        found = resolve_contact_tolerance(identified, STRICTEST["contact.tolerance"])
        values["contact.tolerance"], reasons["contact.tolerance"] = found
    stated = config.resolve(values)
    fitting = config.fit_tolerance if config.types == "meaning" else None
    sight = ContactAnalysis(
        identified, stated.resolved().tolerance, config.pose_tolerance, stated.resolved().up, fitting
    )
    one_surface = any(each.is_cut for each in models)
    rungs = search_settings(sight, _rails(stated, sight, open_keys, one_surface), tries)
    for key, (value, why) in _required(sight, rungs).items():
        if key in require:
            values[key], reasons[key] = value, why
    if not rungs:
        return Resolution(values, reasons, None, 1.0, False, 0)
    chosen = rungs[-1]
    setting = chosen.setting
    hubs = tuple(sight.types[index].name for index in setting.hubs)
    bare = sum(int((~np.isin(each.types, setting.hubs)).sum()) for each in sight.counted(setting))
    left = bare - sum(map(len, sight.staying(setting)))
    ladder = {
        "contact.kinds": setting.kinds,
        "grammar": setting.grammar,
        "hubs.types": hubs or "none",
        "disconnected": "largest" if left else "error",
    }
    for key, value in ladder.items():
        if key in open_keys:
            values[key] = value
            reasons[key] = _reason(key, chosen, rungs)
    if "hubs.types" in open_keys and one_surface:
        reasons["hubs.types"] = "the parts are pieces of one surface, which has a hole where one is left out"
    elif "hubs.types" in open_keys and not chosen.gives_enough and not hubs:
        reasons["hubs.types"] = _without_hub(sight) or reasons["hubs.types"]
    if "disconnected" in open_keys:
        stand = "1 part stands" if left == 1 else f"{left} parts stand"
        reasons["disconnected"] = f"{stand} apart from the largest piece" if left else "nothing stands apart"
    return Resolution(values, reasons, chosen.finds, chosen.kept, chosen.gives_enough, len(rungs))


def resolve_max_copied(finds: TrialResult | None) -> tuple[float, str]:
    """The greatest share of a variant that may be copied whole, and why: near copies are refused where a search that
    found `finds` finds much more, and enough that is none."""
    if finds is None or finds.graphs < SUFFICIENT_GRAPHS:
        return 1.0, "a short search finds too little to refuse any of it"
    if finds.by_meaning:
        return 1.0, "a part that takes another's place leaves all others as they stood"
    if finds.telling < MIN_NON_COPY_RATE:
        return 1.0, f"only {finds.telling:.0%} of the finds of a short search are no near copies"
    beside = f"{finds.telling:.0%} of the finds of a short search are none"
    return NEAR_COPY_SHARE, f"refuses copies with little beside them; {beside}"


def _required(sight: ContactAnalysis, rungs: Sequence[CandidateSetting]) -> dict[str, tuple[Any, str]]:
    """Value and reason of each of REQUIREMENTS, after the rung that was chosen, the last."""
    if not rungs:
        nothing = "there is nothing to search"
        return {
            MAX_COPIED_SHARE_KEY: resolve_max_copied(None),
            STABLE_KEY: (False, nothing),
            REQUIRED_LABELS_KEY: ((), nothing),
        }
    kit, finds = sight.kit(rungs[-1].setting), rungs[-1].finds
    spanning = spanning_labels(kit)
    why = (
        "the exemplars have parts of these as large as themselves" if spanning else "no part is as large as an exemplar"
    )
    return {
        MAX_COPIED_SHARE_KEY: resolve_max_copied(finds),
        STABLE_KEY: resolve_stable(kit, rungs[-1].different),
        REQUIRED_LABELS_KEY: (spanning, why),
    }


def resolve_stable(kit: Kit, different: Sequence[Assembly]) -> tuple[bool, str]:
    """Whether what falls over is refused, and why: where the exemplars of a kit stand, some of the most different finds
    of a short search do not, and enough do."""
    standing = Requirements(stable=True)
    if any(unmet_requirement(standing, kit_shape(kit, each.whole)) for each in kit.exemplars):
        return False, "not even the exemplars stand"
    if not different:
        return False, "a short search finds nothing that could fall"
    falls = sum(unmet_requirement(standing, kit_shape(kit, each)) is not None for each in different)
    told = f"of the {len(different)} most different finds of a short search"
    if not falls:
        return False, f"none {told} falls"
    if len(different) - falls < MIN_NON_COPY_RATE * len(different):
        return False, f"{falls} {told} fall, so that too few would be left"
    return True, f"{falls} {told} fall, and the exemplars stand"


def trial_text(finds: TrialResult) -> str:
    """What a probe found, in words."""
    if not finds.graphs:
        return f"nothing in {finds.tries:,} tries"
    alike = ", much alike" if has_low_diversity(finds) else ""
    return f"{finds.graphs:,} graphs and {finds.histograms:,} histograms in {finds.tries:,} tries{alike}"


def _rails(stated: KitConfig, sight: ContactAnalysis, open_keys: Sequence[str], one_surface: bool) -> SearchSpace:
    """What the ladder may choose from: one value of each key that the config states.

    Hubs are peeled off because shapes stand without them, and get back those that fit. Pieces of one surface are no
    such parts: a piece that does not come back is a hole. By meaning labels alone say what may stand beside what, and
    all of them must have been seen: with looser rules a chair has one leg.
    """
    made = stated.resolved()
    peels = "hubs.types" in open_keys and stated.types != "meaning" and not one_surface
    return SearchSpace(
        kinds=CANDIDATE_KINDS if "contact.kinds" in open_keys else (made.kinds,),
        grammars=CANDIDATE_GRAMMARS if "grammar" in open_keys and stated.types != "meaning" else (made.grammar,),
        hubs=None if peels else hub_types(stated, sight.types),
        largest="disconnected" in open_keys or made.disconnected == "largest",
    )


def _without_hub(sight: ContactAnalysis) -> str:
    """Why not even the hub that touches most was left out, where too little would stay; else empty."""
    hub = sight.widest(())
    stay = sight.parts if hub is None else parts_without_hubs(sight, (hub,))
    if hub is None or stay >= MIN_KEPT_SHARE * sight.parts:
        return ""
    return f"the model falls apart without {sight.types[hub].name}: {stay} of {sight.parts} parts stay in one piece"


def _reason(key: str, chosen: CandidateSetting, rungs: Sequence[CandidateSetting]) -> str:
    """Why the ladder ended at this value of a key: what it found there, and one step stricter in this key alone."""
    setting = chosen.setting
    stricter: list[Setting] = []
    if key == "contact.kinds":
        stricter = [replace(setting, kinds=kinds) for kinds in CANDIDATE_KINDS if len(kinds) > len(setting.kinds)]
    elif key == "grammar" and setting.grammar in CANDIDATE_GRAMMARS:
        stricter = [
            replace(setting, grammar=each) for each in CANDIDATE_GRAMMARS[: CANDIDATE_GRAMMARS.index(setting.grammar)]
        ]
    elif key == "hubs.types" and setting.hubs:
        stricter = [replace(setting, hubs=())]
    for other in reversed(stricter):
        rung = next((each for each in rungs if each.setting == other), None)
        if rung is not None:
            return f"{trial_text(chosen.finds)}; the next stricter: {trial_text(rung.finds)}"
    if chosen.gives_enough:
        return "the strictest, and it gives enough"
    return f"nothing else gives more than {trial_text(chosen.finds)}"
