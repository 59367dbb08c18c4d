"""Resize fallback: where a search finds too few layouts, can the exemplars be resized instead?"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Literal

from pipeline.randomness import decision_rng
from stages.autoconfig.closed_box import is_closed_box
from stages.autoconfig.contact_analysis import ALL_KINDS
from stages.autoconfig.resolve import REQUIREMENT_KEYS, Resolution
from stages.autoconfig.resolved_kit import ResolvedKit
from stages.autoconfig.settings import RANDOM_STREAM
from stages.autoconfig.yield_estimate import LOOK_FIRST, MAX_SAMPLES_REQUESTED, YieldEstimate, rounded_text
from stages.exemplars.build import Observation
from stages.proportions.choice import chosen_texts
from stages.proportions.distinct_warps import DistinctWarps
from stages.proportions.draws import draw_proportions, drawn_layouts
from stages.proportions.settings import ProportionsConfig
from stages.proportions.stage import CANDIDATES_PER_SAMPLE
from stages.proportions.text import ProportionShapes, proportion_text
from stages.proportions.warp import Lattice
from stages.proportions.warp_check import warp_fault
from stages.rows.changes import Change
from stages.rows.divisions import Division
from stages.rows.held_rows import is_held_together
from stages.rows.kit_rows import KitRow, rows_of_kit
from stages.rows.layout import layout_of
from stages.rows.settings import RowsConfig
from stages.shape.kit import Kit
from stages.shape.physics.judge import unmet_requirement
from stages.shape.physics.settings import Requirements
from stages.shape.resolved_settings import FALLBACK_KEY, FALLBACK_STABLE_KEY, PROPORTIONS_FALLBACK, ROWS_FALLBACK
from stages.shape.shape import Shape, kit_shape

Kind = Literal["new plan", "longer or shorter", "other proportions"]
"""What is new in a shape: other parts or others next to each other, other lengths of rows, or other sizes alone."""
TRIAL_DRAWS = 36
"""Draws of a trial, of all exemplars together."""
MAX_LAYOUTS_TRIED = 24
"""Layouts with other rows that a trial draws, of all exemplars together."""
MIN_OTHER_LAYOUTS_FOUND = 2
"""Layouts with other rows from which a dataset has them."""
MIN_LAYOUTS_INSTEAD = 4
"""Layouts with other rows, of at most MAX_LAYOUTS_TRIED, from which these replace what a search finds."""
MAX_ALIKE_DISTANCE = 0.15
"""Median of E (strings §5.3) between the most different layouts of a search up to which these look alike to people."""
MIN_MODULAR_LAYOUTS = 8
"""Layouts with other bays of modules, of at most MAX_LAYOUTS_TRIED, from which these replace layouts that look alike.
Exchange finds no such bays, but it finds rows."""
ALIKE = "what an exchange finds looks alike"
HELD_ROWS = "the parts that hold the rows would stay as they are in an exchange"
MAX_ROWS_SHOWN = 3
MIN_SUCCESS_RATE = 0.2
"""Share of the draws that must hold together; with less a run ends before it has the samples requested."""


@dataclass(frozen=True)
class ResizeEstimate:
    """What resizing a kit's exemplars promises.

    success_rate: share of the draws that hold together.
    different: number of different shapes that a dataset finds, at most MAX_SAMPLES_REQUESTED.
    shapes: the most different of the draws, at most the number asked for, each with what is new in it.
    typical: the first of the draws, as many.
    stable: whether a dataset should require stable shapes, since all exemplars are.
    is_closed_box: whether all exemplars are closed boxes.
    layouts: number of other layouts among the draws, by what is new in them.
    shares: share of each kind in the draws that hold together.
    rows: rows of the exemplars that become longer and shorter, and fronts that are divided.
    """

    success_rate: float
    different: int
    shapes: Sequence[tuple[Shape, Kind]]
    typical: Sequence[tuple[Shape, Kind]]
    stable: bool
    is_closed_box: bool
    layouts: Mapping[Kind, int]
    shares: Mapping[Kind, float]
    rows: Sequence[KitRow] = ()

    @property
    def other_layouts(self) -> int:
        """Number of other layouts among the draws."""
        return sum(self.layouts.values())

    @property
    def has_rows(self) -> bool:
        """Whether there are enough other layouts to speak of."""
        return self.other_layouts >= MIN_OTHER_LAYOUTS_FOUND

    @property
    def sentence(self) -> str:
        """How many shapes there are, and whether they differ visibly."""
        if self.has_rows:
            count = "dozens of" if self.other_layouts >= MAX_LAYOUTS_TRIED else f"about {self.other_layouts}"
            named = "; ".join(row.sentence for row in self.rows[:MAX_ROWS_SHOWN])
            what = " and ".join(dict.fromkeys(row.change for row in self.rows))
            return f"{count} layouts with {what} ({named}), in hundreds of proportions"
        count = "hundreds" if self.different >= MAX_SAMPLES_REQUESTED else f"about {rounded_text(self.different)}"
        sentence = f"{count} of the same layout in other proportions"
        if not self.is_closed_box:
            return sentence
        return f"{sentence} that look alike, since the exemplar is a closed box with plain sides; {LOOK_FIRST}"


@dataclass(frozen=True)
class ResizeFallback:
    """What is resolved where exemplars are resized, and what a run builds then."""

    resolution: Resolution
    built: Observation
    estimate: ResizeEstimate


def resize_fallback(resolved: ResolvedKit, layouts: YieldEstimate | None, max_shapes: int) -> ResizeFallback | None:
    """Return the fallback with at most `max_shapes` shapes; None if it is not needed or not possible.

    It is needed if `layouts` promises next to no layouts or only similar ones, where large parts hold rows, which an
    exchange leaves as they are, and where layouts of a search look alike. It is possible if enough resized exemplars
    hold together.
    layouts: what a search promises; None where its trial found enough
    """
    is_poor = layouts is not None and not resolved.resolution.is_sufficient and layouts.is_poor
    are_held = not is_poor and _holds_rows(resolved)
    if not (is_poor or are_held or _look_alike(resolved)):
        return None
    for own_kinds in (False, True):
        unvaried = _unvaried(resolved, own_kinds)
        built = resolved.observe(unvaried.values)
        estimate = estimate_resizing(built.kit, max_shapes) if not built.refusals else None
        if estimate is not None and estimate.success_rate >= MIN_SUCCESS_RATE:
            break
    else:
        return None
    if are_held and estimate.other_layouts < MIN_LAYOUTS_INSTEAD:
        return None
    has_modules = any(row.is_modular for row in estimate.rows)
    if not (is_poor or are_held) and (not has_modules or estimate.other_layouts < MIN_MODULAR_LAYOUTS):
        return None
    instead = f"of other layouts {layouts.sentence}" if is_poor and layouts else HELD_ROWS if are_held else ALIKE
    reason = f"{estimate.success_rate:.0%} of what is drawn holds together; {instead}"
    stable_reason = "the exemplars are stable" if estimate.stable else "not even the exemplars are stable"
    fallback = ROWS_FALLBACK if estimate.has_rows else PROPORTIONS_FALLBACK
    values = {**unvaried.values, FALLBACK_KEY: fallback, FALLBACK_STABLE_KEY: estimate.stable}
    reasons = {**unvaried.reasons, FALLBACK_KEY: reason, FALLBACK_STABLE_KEY: stable_reason}
    return ResizeFallback(replace(unvaried, values=values, reasons=reasons), built, estimate)


def _look_alike(resolved: ResolvedKit) -> bool:
    """Return whether the layouts of a trial search look alike."""
    trial, kit = resolved.resolution.trial, resolved.observe(resolved.resolution.values).kit
    return trial is not None and trial.pair_distance <= MAX_ALIKE_DISTANCE and not (kit.one_surface or kit.by_meaning)


def _holds_rows(resolved: ResolvedKit) -> bool:
    """Return whether parts that span rows hold most of each exemplar."""
    built = resolved.observe(resolved.resolution.values)
    if built.refusals or built.kit.one_surface or built.kit.by_meaning:
        return False
    return all(is_held_together(layout_of(built.kit, exemplar)) for exemplar in built.kit.exemplars)


def _unvaried(resolved: ResolvedKit, own_kinds: bool) -> Resolution:
    """Return the settings for unchanged layouts, which need no graph that can be searched.

    All kinds of contact count, or those of the search (`own_kinds`). Hubs stay, pieces stay if a run accepts them, and
    nothing is required of layouts.
    """
    resolution = resolved.resolution
    unvaried: dict[str, tuple[Any, str]] = {
        **({} if own_kinds else {"contact.kinds": (ALL_KINDS, "every contact is kept, only sizes change")}),
        "hubs.types": ("none", "all parts stay, only sizes change"),
        "disconnected": ("error", "no part is apart"),
    }
    pairs = {
        key: unvaried.get(key, (value, resolution.reasons[key]))
        for key, value in resolution.values.items()
        if key not in REQUIREMENT_KEYS
    }
    values, reasons = {key: value for key, (value, _) in pairs.items()}, {key: why for key, (_, why) in pairs.items()}
    if resolved.observe(values).refusals:
        values["disconnected"], reasons["disconnected"] = "largest", "parts are apart from the largest piece"
    return replace(resolution, values=values, reasons=reasons)


def _kind(changes: Sequence[Change]) -> Kind:
    """Return what is new in a layout with some changes."""
    if any(isinstance(change, Division) for change in changes):
        return "new plan"
    return "longer or shorter" if changes else "other proportions"


def _different(lattice: Lattice, config: ProportionsConfig, exemplar: int, wanted: int) -> int:
    """Return how many different shapes of an exemplar a run finds that wants `wanted`, if all hold together."""
    rng = decision_rng(0, RANDOM_STREAM, "different", exemplar)
    distinct = DistinctWarps(lattice, config.min_difference)
    for _ in range(config.oversample * CANDIDATES_PER_SAMPLE * wanted):
        warp = lattice.draw(rng, config.log_std, config.max_factor)
        if distinct.is_new(warp):
            distinct.add(warp)
        if len(distinct) == CANDIDATES_PER_SAMPLE * wanted:
            break
    return len(distinct.farthest_first(wanted))


def estimate_resizing(kit: Kit, max_shapes: int) -> ResizeEstimate:
    """Draw resized exemplars of a kit, with all of their parts, and where they have rows, longer and shorter ones;
    randomness depends on the kit only.
    """
    config, rows = ProportionsConfig(), RowsConfig()
    required = Requirements(stable=True)
    stable = all(unmet_requirement(required, kit_shape(kit, exemplar.whole)) is None for exemplar in kit.exemplars)
    config = config.model_copy(update={"require": required if stable else Requirements()})
    count, shapes_of = len(kit.exemplars), ProportionShapes(kit)
    tried = different = 0
    shapes: list[tuple[Shape, Kind]] = []
    typical: list[tuple[Shape, Kind]] = []
    others, held = Counter[Kind](), Counter[Kind]()
    for number, exemplar in enumerate(kit.exemplars):
        streams = partial(decision_rng, 0, RANDOM_STREAM, "rows", number)
        wanted = -(-MAX_LAYOUTS_TRIED // count)
        layouts = drawn_layouts(shapes_of, exemplar.name, config, rows, wanted, streams, lambda *_: None)
        others.update(_kind(layout.changes) for layout in layouts if layout.changes)
        sides = shapes_of.unwarped(exemplar.name, ()).lattice.sides
        texts: list[str] = []
        made: dict[str, tuple[Shape, Kind]] = {}
        for draw in range(-(-TRIAL_DRAWS // count)):
            rng = decision_rng(0, RANDOM_STREAM, "proportions", number, draw)
            layout = layouts[draw % len(layouts)]
            proportions = draw_proportions(exemplar.name, layout, sides, rng, config, rows)
            shape = shapes_of.warped(layout.unwarped, proportions.warp)
            tried += 1
            fault = warp_fault(kit, layout.unwarped.assembly, shape) or unmet_requirement(config.require, shape)
            if fault is None:
                texts.append(proportion_text(proportions))
                made[texts[-1]] = shape, _kind(layout.changes)
        held.update(kind for _, kind in made.values())
        shown = len(range(number, max_shapes, count))
        shapes += [made[text] for text, _ in chosen_texts(shapes_of, texts, shown, config.min_difference)]
        typical += list(made.values())[:shown]
        lattice = shapes_of.unwarped(exemplar.name, ()).lattice
        different += _different(lattice, config, number, len(range(number, MAX_SAMPLES_REQUESTED, count)))
    closed = all(is_closed_box(kit_shape(kit, exemplar.whole)) for exemplar in kit.exemplars)
    found = rows_of_kit(kit) if others else ()
    return ResizeEstimate(
        success_rate=held.total() / max(tried, 1),
        different=different,
        shapes=shapes,
        typical=typical,
        stable=stable,
        is_closed_box=closed,
        layouts=others,
        shares={kind: count / held.total() for kind, count in held.items()},
        rows=found,
    )
