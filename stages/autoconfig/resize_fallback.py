"""Where a search of layouts gives too little: can the models be made in other proportions?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from pipeline.randomness import decision_rng
from stages.autoconfig.closed_box import is_closed_box
from stages.autoconfig.resolve import REQUIREMENT_KEYS, Resolution
from stages.autoconfig.resolved_kit import ResolvedKit
from stages.autoconfig.yield_estimate import LOOK_FIRST, YieldEstimate, rounded_text
from stages.exemplars.build import Observation
from stages.inspection.config_text import MAX_SAMPLES_REQUESTED
from stages.proportions.distinct_warps import DistinctWarps
from stages.proportions.settings import ProportionsConfig
from stages.proportions.stage import CANDIDATES_PER_SAMPLE
from stages.proportions.warp import Lattice, lattice_of, warped
from stages.proportions.warp_check import warp_fault
from stages.shape.kit import Kit
from stages.shape.physics.judge import unmet_requirement
from stages.shape.physics.settings import Requirements
from stages.shape.resolved_settings import FALLBACK_KEY, FALLBACK_STABLE_KEY
from stages.shape.shape import Shape, kit_shape

TRIES = 36
"""Draws of a probe, of all exemplars together."""
LEAST = 0.2
"""Share of them that must hold together; with less a run ends before it has what it wants."""


@dataclass(frozen=True)
class ResizeEstimate:
    """What other proportions of a kit's exemplars promise.

    holds: share of the draws that hold together; different: how many that differ a dataset finds, of MOST at most;
    shapes: the most different of the draws, at most as many as asked for; stable: whether a dataset should ask that
    shapes stand, for all exemplars do; plain: whether all exemplars are closed boxes; enough: whether it is worth one.
    """

    holds: float
    different: int
    shapes: Sequence[Shape]
    stable: bool
    plain: bool

    @property
    def enough(self) -> bool:
        return self.holds >= LEAST

    @property
    def sentence(self) -> str:
        """How many there are, and whether they differ to the eye."""
        many = "hundreds" if self.different >= MAX_SAMPLES_REQUESTED else f"about {rounded_text(self.different)}"
        said = f"{many} of the same layout in other proportions"
        if not self.plain:
            return said
        return f"{said} that look alike, for it is a closed box with plain sides, whatever is in it; {LOOK_FIRST}"


@dataclass(frozen=True)
class ResizeFallback:
    """What is chosen where exemplars come in other proportions instead of other layouts, and what a run builds then."""

    choices: Resolution
    built: Observation
    proportioned: ResizeEstimate


def resize_fallback(reading: ResolvedKit, expected: YieldEstimate, shown: int) -> ResizeFallback | None:
    """Other proportions with at most `shown` shapes, where `expected` promises next to no other layouts, or all alike,
    and the exemplars hold together in other proportions."""
    if reading.choices.enough or not expected.is_poor:
        return None
    unvaried = _unvaried(reading)
    built = reading.observe(unvaried.values)
    found = estimate_resizing(built.kit, shown) if not built.refusals else None
    if found is None or not found.enough:
        return None
    why = f"{found.holds:.0%} of what is drawn holds together; of other layouts {expected.sentence}"
    stands = "the exemplars stand" if found.stable else "not even the exemplars stand"
    values = {**unvaried.values, FALLBACK_KEY: "proportions", FALLBACK_STABLE_KEY: found.stable}
    reasons = {**unvaried.reasons, FALLBACK_KEY: why, FALLBACK_STABLE_KEY: stands}
    return ResizeFallback(replace(unvaried, values=values, reasons=reasons), built, found)


def _unvaried(reading: ResolvedKit) -> Resolution:
    """What is chosen where layouts stay as they are: no hub is left out, of what stands apart the largest piece stays,
    and nothing is required of layouts."""
    choices = reading.choices
    others = {
        "hubs.types": ("none", "all parts stay, only sizes change"),
        "disconnected": ("error", "nothing stands apart"),
    }
    open_keys = others.keys() & choices.values.keys()
    kept = [key for key in choices.values if key not in REQUIREMENT_KEYS]
    values = {key: others[key][0] if key in open_keys else choices.values[key] for key in kept}
    reasons = {key: others[key][1] if key in open_keys else choices.reasons[key] for key in kept}
    if reading.observe(values).refusals:
        values["disconnected"], reasons["disconnected"] = "largest", "parts stand apart from the largest piece"
    return replace(choices, values=values, reasons=reasons)


def _different(lattice: Lattice, config: ProportionsConfig, exemplar: int, most: int) -> int:
    """How many different shapes of an exemplar a run finds that wants `most`, if all of them hold together."""
    rng = decision_rng(0, "choices", "different", exemplar)
    drawn = DistinctWarps(lattice, config.min_difference)
    for _ in range(config.oversample * CANDIDATES_PER_SAMPLE * most):
        warp = lattice.draw(rng, config.log_std, config.max_factor)
        if drawn.is_new(warp):
            drawn.add(warp)
        if len(drawn) == CANDIDATES_PER_SAMPLE * most:
            break
    return len(drawn.farthest_first(most))


def estimate_resizing(kit: Kit, shown: int) -> ResizeEstimate:
    """A probe of the exemplars of a kit, with all of their parts; what is random depends on the kit alone."""
    config = ProportionsConfig()
    stands = Requirements(stable=True)
    stable = all(unmet_requirement(stands, kit_shape(kit, each.whole)) is None for each in kit.exemplars)
    require = stands if stable else Requirements()
    tried = held = different = 0
    found: list[Shape] = []
    for number, exemplar in enumerate(kit.exemplars):
        lattice = lattice_of(kit, exemplar.whole)
        kept: list[Shape] = []
        drawn = DistinctWarps(lattice, config.min_difference)
        for place in range(-(-TRIES // len(kit.exemplars))):
            rng = decision_rng(0, "choices", "proportions", number, place)
            warp = lattice.draw(rng, config.log_std, config.max_factor)
            shape = warped(kit, exemplar.whole, lattice, warp)
            tried += 1
            if warp_fault(kit, exemplar.whole, shape) is None and unmet_requirement(require, shape) is None:
                kept.append(shape)
                drawn.add(warp)
        held += len(kept)
        found += [kept[place] for place in drawn.farthest_first(len(range(number, shown, len(kit.exemplars))))]
        different += _different(lattice, config, number, len(range(number, MAX_SAMPLES_REQUESTED, len(kit.exemplars))))
    plain = all(is_closed_box(kit_shape(kit, each.whole)) for each in kit.exemplars)
    return ResizeEstimate(held / max(tried, 1), different, found, stable, plain)
