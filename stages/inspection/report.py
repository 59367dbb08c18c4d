"""Models looked at from end to end: what is seen in them, what is chosen for them, and what they will give."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Any

from stages.autoconfig.resize_fallback import ResizeEstimate, resize_fallback
from stages.autoconfig.resolve import REQUIREMENT_KEYS, Resolution, resolve_settings, trial_text
from stages.autoconfig.resolved_kit import ResolvedKit, use_sections_if_empty
from stages.autoconfig.yield_estimate import YieldEstimate, estimate_yield
from stages.exemplars.build import Observation
from stages.exemplars.identify import identify_parts
from stages.exemplars.model import Model
from stages.exemplars.settings import KitConfig, ReadLimits
from stages.inspection.sample_figure import MAX_SHAPES_SHOWN
from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.physics.judge import unmet_requirement
from stages.shape.physics.settings import Requirements
from stages.shape.resolved_settings import MAX_COPIED_SHARE_KEY, STABLE_KEY
from stages.shape.shape import Shape, kit_shape
from stages.variations.requirements.hub_restoration import HubRestorer, auto_min_hubs
from stages.variations.selection.orientation import OrientationFix

ACROSS = (
    "cut it across, between bays and storeys with all that passes there: `parts: sections`; or where it is like itself "
    "elsewhere: `parts: symmetry`, which writes a shape grammar, too"
)
"""What helps where one mesh has a part that touches all others."""


@dataclass(frozen=True)
class InspectionReport:
    """What some models will give.

    config: nothing left open; models: as they are read by it; asked: the config that they were looked at with; seen:
    all parts under what was chosen, hubs and what falls apart among them; built: what a run builds; forecast: None
    where a run would refuse the models; shapes: what it may look like; rate: variants found a CPU second; seconds: CPU
    seconds of it all; torn: whether the parts are pieces of meshes that nobody but `auto` chose; proportioned: what
    other proportions promise where other layouts are too few or too dull, and then config and built are for these.
    """

    config: KitConfig
    models: Sequence[Model]
    asked: KitConfig
    choices: Resolution
    seen: Observation
    built: Observation
    yield_estimate: YieldEstimate | None
    shapes: Sequence[Shape]
    rate: float
    seconds: float
    torn: bool
    proportioned: ResizeEstimate | None

    @property
    def sentence(self) -> str:
        """What to expect."""
        if self.yield_estimate is None:
            return f"nothing, for a run refuses the models: {self.built.refusals[0]}"
        said = self.yield_estimate.sentence
        if self.torn and not self.yield_estimate.finds.graphs:
            said = f"{said}; or {ACROSS}"
        if self.proportioned is None:
            return said
        return f"{self.proportioned.sentence}; of other layouts {said}"

    def as_json(self) -> Mapping[str, Any]:
        """Choices and forecast, beside what `inspection` finds."""
        made = self.choices.as_json()
        expected: dict[str, Any] = {"sentence": self.sentence}
        if self.yield_estimate is not None:
            expected |= {
                **self.yield_estimate.finds.as_json(),
                "layouts": self.yield_estimate.layouts,
                "variants_a_cpu_second": round(self.rate, 1),
                "seen_once": round(self.yield_estimate.unique_pattern_share, 4),
            }
        if self.proportioned is not None:
            expected["proportions"] = {"holds": round(self.proportioned.holds, 4), "stable": self.proportioned.stable}
        return {"autoconfig": made, "yield_estimate": expected, "cpu_seconds": round(self.seconds, 1)}

    def lines(self) -> list[tuple[str, str]]:
        """Title and text of each thing that was chosen and foreseen."""
        chosen = [(key, f"{_shown(each)}: {self.choices.reasons[key]}") for key, each in self.choices.values.items()]
        lines = [*chosen, ("yield_estimate", self.sentence)]
        if self.yield_estimate is not None:
            whole = f"half of the finds have {self.yield_estimate.finds.copied:.0%} or more in one piece of an exemplar"
            once = f"{self.yield_estimate.unique_pattern_share:.0%} of the parts stand in a pattern that occurs once"
            lines += [
                ("search", f"{trial_text(self.yield_estimate.finds)}, {self.rate:.3g} variants a CPU second"),
                ("copied", whole),
                ("patterns", once),
            ]
        return lines


def inspect_models(
    config: KitConfig, models: Sequence[Model], tries: int, limits: ReadLimits | None = None
) -> InspectionReport:
    """Decide what `config` leaves open, and forecast what comes of it. Models that are read otherwise, as
    `use_sections_if_empty` says, are read within `limits`.

    Raises ConfigError for a model in which no part has any area, and for stated hubs that are no types.
    """
    start = time.process_time()
    identified = identify_parts(models, config)
    first = ResolvedKit(config, models, identified, resolve_settings(config, models, identified, tries))
    reading = use_sections_if_empty(first, limits or ReadLimits(), tries, REQUIREMENT_KEYS)
    models, choices = reading.models, reading.choices
    decided = reading.config.resolve(choices.values)
    built = seen = reading.observe(choices.values)
    if decided.resolved().hubs or decided.resolved().disconnected == "largest":
        seen = reading.observe({**choices.values, "hubs.types": "none", "disconnected": "error"})
    expected, assemblies, rate = None, [], 0.0
    if not built.refusals:
        answers = ContactOracle(built.kit)
        begun = time.process_time()
        expected = foreseen(config, reading, answers, tries)
        rate = expected.finds.graphs / max(time.process_time() - begun, 1e-6)
        backdrop = HubRestorer(answers, upright=True)
        asked = Requirements(stable=choices.values[STABLE_KEY])
        fitted = (backdrop.fit(each.assembly) for each in expected.chosen)
        kept = (each for each in fitted if unmet_requirement(asked, kit_shape(built.kit, each)) is None)
        facing = OrientationFix(built.kit)
        assemblies = [facing.turned_back(each, facing.turn(each)) for each in islice(kept, MAX_SHAPES_SHOWN)]
    shapes = [kit_shape(built.kit, each) for each in assemblies]
    proportioned = None
    instead = None if expected is None else resize_fallback(reading, expected, MAX_SHAPES_SHOWN)
    if instead is not None:
        proportioned, choices, built = instead.proportioned, instead.choices, instead.built
        decided, shapes = reading.config.resolve(choices.values), list(proportioned.shapes)
    torn = reading.config.parts == "auto" and all(each.segmentation not in ("nodes", "objects") for each in models)
    seconds = time.process_time() - start
    return InspectionReport(
        decided, models, config, choices, seen, built, expected, shapes, rate, seconds, torn, proportioned
    )


def foreseen(asked: KitConfig, reading: ResolvedKit, answers: ContactOracle, tries: int) -> YieldEstimate:
    """What a short search promises of the layouts of the kit of `answers`, which is built as `reading` has chosen of
    what `asked` leaves open."""
    choices = reading.choices
    known = choices.finds.graphs if choices.finds is not None else 0
    hubs = auto_min_hubs(asked, answers.kit)
    return estimate_yield(answers.kit, answers, tries, known, hubs, choices.values.get(MAX_COPIED_SHARE_KEY, 1.0))


def _shown(value: Any) -> str:
    return ", ".join(value) if isinstance(value, tuple) else str(value)
