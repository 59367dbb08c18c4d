"""Inspect models from end to end: their observation, their resolved settings and the estimated yield."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Any

from pipeline.randomness import decision_rng
from stages.autoconfig.contact_analysis import ContactAnalysis
from stages.autoconfig.resize_fallback import ResizeEstimate, resize_fallback
from stages.autoconfig.resolve import REQUIREMENT_KEYS, Resolution, resolve_contacts, trial_text
from stages.autoconfig.resolved_kit import resolve_models
from stages.autoconfig.settings import RANDOM_STREAM
from stages.autoconfig.yield_estimate import YieldEstimate
from stages.exemplars.build import Observation
from stages.exemplars.identify import identify_parts
from stages.exemplars.model import Model
from stages.exemplars.settings import KitConfig
from stages.inspection.forecast import Forecast, forecast, kind_of
from stages.inspection.observation import contact_sentences, types_sentence
from stages.inspection.sample_figure import MAX_SHAPES_SHOWN, ShownShape
from stages.model_files.limits import ReadLimits
from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.kit import Kit
from stages.shape.physics.judge import unmet_requirement
from stages.shape.physics.settings import Requirements
from stages.shape.resolved_settings import STABLE_KEY
from stages.shape.shape import kit_shape
from stages.variations.requirements.hub_restoration import HubRestorer
from stages.variations.search.variant import Variant
from stages.variations.selection.orientation import OrientationFix

OTHER_CUTS = (
    "cut it across, between bays and storeys with all that crosses there: `parts: sections`; or where it repeats "
    "itself: `parts: symmetry`, which writes a shape grammar, too"
)
"""The remedy if one part of a mesh touches all others."""


@dataclass(frozen=True)
class InspectionReport:
    """What some models hold and what a run will make of them.

    config: the kit's config with every key resolved; that of the resize fallback if there is one.
    models: the models as this config reads them.
    resolution: the resolved settings with their reasons.
    observed: all parts, with hubs and with pieces that are apart.
    built: what a run builds.
    layouts: the yield estimate of new layouts; None if a run refuses the models.
    shapes: the most different of what a short search makes and a run accepts.
    typical: as many at random.
    variants_per_second: variants found a CPU second.
    seconds: CPU seconds of the inspection.
    is_fragmented: whether the parts are pieces of meshes that only `auto` chose.
    resizing: the estimate of the resize fallback, if layouts are too few or too similar.
    """

    config: KitConfig
    models: Sequence[Model]
    resolution: Resolution
    observed: Observation
    built: Observation
    layouts: YieldEstimate | None
    shapes: Sequence[ShownShape]
    typical: Sequence[ShownShape]
    variants_per_second: float
    seconds: float
    is_fragmented: bool
    resizing: ResizeEstimate | None

    @property
    def sentence(self) -> str:
        """What to expect."""
        if self.layouts is None:
            return f"nothing, since a run refuses the models: {self.built.refusals[0]}"
        sentence = self.layouts.sentence
        if self.is_fragmented and not self.layouts.trial.graphs:
            sentence = f"{sentence}; or {OTHER_CUTS}"
        return sentence if self.resizing is None else f"{self.resizing.sentence}; of other layouts {sentence}"

    @property
    def forecast(self) -> Forecast:
        """What a run makes, by kind."""
        return forecast(self.built.kit, self.layouts, self.resizing)

    def as_json(self) -> Mapping[str, Any]:
        """Return resolved settings and estimates, as JSON."""
        kinds = {"shares": self.forecast.shares, "numbers": self.forecast.numbers, "typical": self.forecast.typical}
        estimate: dict[str, Any] = {"sentence": self.sentence, "kinds": kinds}
        if self.layouts is not None:
            estimate |= {
                **self.layouts.trial.as_json(),
                "layouts": self.layouts.layouts,
                "variants_per_cpu_second": round(self.variants_per_second, 1),
                "seen_once": round(self.layouts.unique_pattern_share, 4),
            }
        if self.resizing is not None:
            success_rate = round(self.resizing.success_rate, 4)
            estimate["proportions"] = {"success_rate": success_rate, "stable": self.resizing.stable}
        return {
            "autoconfig": self.resolution.as_json(),
            "yield_estimate": estimate,
            "cpu_seconds": round(self.seconds, 1),
        }

    def lines(self) -> list[tuple[str, str]]:
        """Return title and text of each resolved setting and each estimate."""
        lines = []
        for key, value in self.resolution.values.items():
            shown = ", ".join(value) if isinstance(value, tuple) else str(value)
            lines.append((key, f"{shown}: {self.resolution.reasons[key]}"))
        lines.append(("yield", self.sentence))
        lines += self.forecast.lines()
        if self.layouts is not None:
            trial = self.layouts.trial
            rate = f", {self.variants_per_second:.3g} variants a CPU second" if trial.graphs else ""
            lines.append(("search", f"{trial_text(trial)}{rate}"))
            if trial.graphs:
                share = f"{trial.copied_share:.0%}"
                lines.append(("copied", f"half of the hits have {share} or more in one piece of an exemplar"))
            once = f"{self.layouts.unique_pattern_share:.0%} of the parts have a pattern that occurs once"
            lines.append(("patterns", once))
        return lines

    def table_cells(self) -> dict[str, str]:
        """Return the cells of a table row by their headers."""
        settings, kit = self.config.resolved(), self.observed.kit
        trial = self.layouts.trial if self.layouts is not None else None
        return {
            "parts": str(sum(len(exemplar.assembly) for exemplar in kit.exemplars)),
            "types": str(len(kit.types)),
            "up": settings.up,
            "tolerance": f"{settings.tolerance:g}",
            "kinds": ", ".join(settings.kinds),
            "grammar": settings.grammar,
            "hubs": ", ".join(settings.hubs) or "none",
            "kept": f"{self.resolution.kept_share:.0%}",
            "graphs": f"{trial.graphs:,}" if trial else "0",
            "histograms": f"{trial.histograms:,}" if trial else "0",
            "distance": f"{trial.distance:.2f}" if trial else "",
            "CPU s": f"{self.seconds:.0f}",
            "yield estimate": self.sentence,
        }


def inspect_models(
    config: KitConfig,
    models: Sequence[Model],
    tries: int,
    limits: ReadLimits | None = None,
    tell: Callable[[str], None] = lambda _: None,
) -> InspectionReport:
    """Resolve what `config` leaves at `auto`, and estimate what a run will find.

    limits: for models that are read again, as `use_sections_if_empty` does
    tell: is told types, contacts and up axis, a sentence each, as soon as they are known

    Raises ConfigError for a model in which no part has any area, and for stated hubs that are no types.
    """
    start = time.process_time()
    identified = identify_parts(models, config)
    tell(types_sentence(identified))
    analyses: dict[Any, ContactAnalysis] = {}
    for sentence in contact_sentences(resolve_contacts(config, models, identified, analyses), models):
        tell(sentence)
    resolved = resolve_models(config, models, identified, limits or ReadLimits(), tries, REQUIREMENT_KEYS, analyses)
    resolution = resolved.resolution
    stated = resolved.config.resolve(resolution.values)
    built = resolved.observe(resolution.values)
    layouts, rate, resizing = None, 0.0, None
    shapes: list[ShownShape] = []
    typical: list[ShownShape] = []
    if not built.refusals:
        oracle = ContactOracle(built.kit)
        layouts = resolved.estimate(config, oracle, tries)
        rate = layouts.trial.graphs / max(layouts.seconds, 1e-6)
        stable = resolution.values[STABLE_KEY]
        likely = layouts.likely_variants(built.kit)
        at_random = decision_rng(0, RANDOM_STREAM, "typical").permutation(len(likely)).tolist()
        shapes = _example_shapes(built.kit, oracle, layouts.most_different, stable)
        typical = _example_shapes(built.kit, oracle, [likely[index] for index in at_random], stable)
        fallback = resize_fallback(resolved, layouts, MAX_SHAPES_SHOWN)
        if fallback is not None:
            resizing, resolution, built = fallback.estimate, fallback.resolution, fallback.built
            stated = resolved.config.resolve(resolution.values)
            shapes, typical = (
                [ShownShape(shape, kind) for shape, kind in drawn] for drawn in (resizing.shapes, resizing.typical)
            )
    observed = built
    if stated.resolved().hubs or stated.resolved().disconnected == "largest":
        observed = resolved.observe({**resolution.values, "hubs.types": "none", "disconnected": "error"})
    by_author = any(model.segmentation in ("nodes", "objects") for model in resolved.models)
    is_fragmented = resolved.config.parts == "auto" and not by_author
    seconds = time.process_time() - start
    return InspectionReport(
        config=stated,
        models=resolved.models,
        resolution=resolution,
        observed=observed,
        built=built,
        layouts=layouts,
        shapes=shapes,
        typical=typical,
        variants_per_second=rate,
        seconds=seconds,
        is_fragmented=is_fragmented,
        resizing=resizing,
    )


def _example_shapes(kit: Kit, oracle: ContactOracle, hits: Sequence[Variant], stable: bool) -> list[ShownShape]:
    """Return the first hits that a run accepts, with their hubs restored and turned upright."""
    restorer, orientation, required = (
        HubRestorer(oracle, upright=True),
        OrientationFix(kit),
        Requirements(stable=stable),
    )
    restored = ((restorer.fit(hit.assembly), kind_of(hit)) for hit in hits)
    accepted = (
        (assembly, kind) for assembly, kind in restored if unmet_requirement(required, kit_shape(kit, assembly)) is None
    )
    return [
        ShownShape(kit_shape(kit, orientation.turned_back(assembly, orientation.turn(assembly))), kind)
        for assembly, kind in islice(accepted, MAX_SHAPES_SHOWN)
    ]
