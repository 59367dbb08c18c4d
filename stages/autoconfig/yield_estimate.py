"""Yield estimate: what a run will find, predicted by a trial search of the kit that it will build."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.randomness import decision_rng
from stages.autoconfig.lost_support import lost_support
from stages.autoconfig.setting_search import MIN_USEFUL_GRAPHS
from stages.autoconfig.settings import RANDOM_STREAM
from stages.autoconfig.trial_search import TrialResult, TrialSearch, has_low_diversity, type_counts
from stages.rows.settings import RowsConfig
from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.graphs.patterns import observed_patterns, unique_pattern_share
from stages.shape.kit import Kit
from stages.variations.novelty.low_diversity import NEAR_COPY_SHARE
from stages.variations.report.advice import another_model, what_keeps
from stages.variations.requirements.identity import lost_label_counts
from stages.variations.search.variant import DUPLICATE, Variant
from stages.variations.settings import SelectionConfig

MAX_ESTIMATE_GRAPHS = 300
"""Distinct graphs at which the trial search of an estimate ends."""
MAX_SAMPLES_REQUESTED = 200
"""Samples that an inspection's config requests, if there are enough."""
MIN_PARTS_LISTS = 50
"""Parts lists below which a dataset of MAX_ESTIMATE_GRAPHS shapes has each of them many times."""
MIN_WHOLE_SHARE = 0.5
"""Share of the hits with nearly a whole exemplar in one piece from which a forecast says that they look like it."""
LOOK_FIRST = "look at the sheet before you make many"
MAX_LABELS_SHOWN = 2
ESTIMATE_TRIES_FACTOR = 4
"""Tries of an estimate as a multiple of a trial search's, if the first of them find something."""


@dataclass(frozen=True)
class YieldEstimate:
    """What a trial search of a kit found, and what it predicts of a long search.

    trial: the result of the trial search.
    layouts: estimated number of distinct graphs; None if very many.
    part_range: smallest and largest number of parts of the hits.
    seen_once: share of parts whose pattern occurs once.
    sentence: what to expect, and the remedy.
    variants: the hits.
    lost_support: the labels whose parts lose what is close above or below them.
    row_variants: exemplars with longer or shorter rows, with which a run begins its search; no hits of the trial.
    seconds: CPU seconds that it took.
    """

    trial: TrialResult
    layouts: int | None
    part_range: tuple[int, int]
    unique_pattern_share: float
    sentence: str
    variants: Sequence[Variant]
    lost_support: tuple[str, ...] = ()
    row_variants: Sequence[Variant] = ()
    seconds: float = 0.0

    @property
    def is_poor(self) -> bool:
        """Whether the layouts make no dataset: next to none, all alike, or broken."""
        few = not self.trial.graphs or (self.layouts is not None and self.layouts < MIN_USEFUL_GRAPHS)
        return few or has_low_diversity(self.trial) or bool(self.lost_support)

    def likely_variants(self, kit: Kit) -> list[Variant]:
        """The hits and the exemplars with other rows that a run would select: those that lack fewest part types, as
        large a share of them as a run selects of its pool."""
        found = [*self.variants, *self.row_variants]
        counts = type_counts(kit, [variant.assembly.types for variant in found]).astype(np.int64)
        lost = lost_label_counts(kit, counts)
        if not lost.any():
            return found
        share = 0.0 if self.layouts is None else MAX_SAMPLES_REQUESTED / max(self.layouts, MAX_SAMPLES_REQUESTED)
        share = max(share, 1 / SelectionConfig().oversample)
        selected = np.argsort(lost, kind="stable")[: math.ceil(share * len(found))]
        return [found[index] for index in selected.tolist()]

    @property
    def most_different(self) -> list[Variant]:
        """The most different hits, most different first."""
        return [self.variants[index] for index in self.trial.most_different]


def estimate_yield(
    kit: Kit,
    oracle: ContactOracle,
    tries: int,
    known_graphs: int = 0,
    min_hubs: float = 0,
    max_copied_share: float = 1.0,
    keep_types: Sequence[str] = (),
) -> YieldEstimate:
    """Search a kit for a short time; the random stream depends on the kit only.

    oracle: that of `kit`.
    known_graphs: graphs that an earlier trial search found; if there are any, a first search in vain is continued.
    min_hubs, max_copied_share, keep_types: as for TrialSearch, since rejected variants do not count.
    """
    begun = time.process_time()
    rng = decision_rng(0, RANDOM_STREAM, "forecast")
    search = TrialSearch(oracle, rng, min_hubs, max_copied_share, keep_types=keep_types)
    trial = search.run(tries, MAX_ESTIMATE_GRAPHS, evenly=True)
    if trial.graphs or known_graphs:
        trial = search.run((ESTIMATE_TRIES_FACTOR - 1) * tries, MAX_ESTIMATE_GRAPHS, evenly=True)
    layouts = _layouts(trial)
    sizes = [len(variant.assembly) for variant in search.variants]
    part_range = (min(sizes, default=0), max(sizes, default=0))
    once = unique_pattern_share(observed_patterns(kit, oracle.dockings, upright=True))
    unsupported = lost_support(kit, [search.with_hubs(index) for index in trial.most_different])
    whole = [variant.lineage["copied"]["exemplar_share"] > NEAR_COPY_SHARE for variant in search.variants]
    sentence = _sentence(kit, trial, layouts, part_range, unsupported, float(np.mean(whole)) if whole else 0.0)
    wanted = round(RowsConfig().pool_share * min(len(search.variants), MAX_ESTIMATE_GRAPHS))
    row_variants = search.other_rows(decision_rng(0, RANDOM_STREAM, "rows"), wanted) if wanted else []
    seconds = time.process_time() - begun
    return YieldEstimate(
        trial, layouts, part_range, once, sentence, search.variants, unsupported, row_variants, seconds
    )


def _layouts(trial: TrialResult) -> int | None:
    """Estimate the number of distinct graphs from how often the search found known ones.

    Of N equally likely graphs, n draws are expected to show N (1 - exp(-n / N)) distinct ones. The result is None if
    few graphs came twice.
    """
    graphs, repeats = trial.graphs, trial.rejects.get(DUPLICATE, 0)
    if graphs == 0:
        return 0
    if graphs >= MAX_ESTIMATE_GRAPHS or repeats < graphs:
        return None
    low, high = float(graphs), 1e6
    while high / low > 1.01:
        middle = (low * high) ** 0.5
        low, high = (middle, high) if middle * -np.expm1(-(graphs + repeats) / middle) < graphs else (low, middle)
    return round(low)


def _sentence(
    kit: Kit,
    trial: TrialResult,
    layouts: int | None,
    part_range: tuple[int, int],
    unsupported: tuple[str, ...],
    whole_share: float,
) -> str:
    """Say what to expect. whole_share: share of the hits that hold nearly a whole exemplar in one piece."""
    if not trial.graphs:
        return f"nothing: {what_keeps(kit, trial.rejects, trial.tries)}"
    low, high = part_range
    size = f"{low} to {high} parts" if low < high else f"{low} parts each"
    count = "hundreds of layouts" if layouts is None else f"about {rounded_text(layouts)} layout{'s'[: layouts != 1]}"
    if layouts is not None and layouts < MIN_USEFUL_GRAPHS:
        return f"{count}, no dataset: {what_keeps(kit, trial.rejects, trial.tries)}"
    if layouts is not None:  # a lower bound: rare layouts are missed, and a long search builds on what it found
        count = f"{rounded_text(layouts)} or more layouts"
    if unsupported:
        names = " and ".join(unsupported[:MAX_LABELS_SHOWN])
        names += " and others" if len(unsupported) > MAX_LABELS_SHOWN else ""
        why = f"nothing is close above or below {names}, as it is in the exemplar"
        return f"{count} of {size} that look broken: {why}; {LOOK_FIRST}, and bring {another_model(kit)}"
    if has_low_diversity(trial):
        is_like_exemplar = trial.pair_distance >= trial.distance or trial.looks_like_exemplar
        alike = "like the exemplar" if is_like_exemplar else "like each other"
        return f"{count} of {size} that look {alike}; {LOOK_FIRST}, and bring {another_model(kit)}"
    if trial.histograms < MIN_PARTS_LISTS and not trial.by_meaning:
        few = f"with only about {rounded_text(trial.histograms)} parts lists: many will look alike"
        return f"{count} of {size}, {few}; {LOOK_FIRST}, and bring {another_model(kit)}"
    lists = f"{count} of {size}, {rounded_text(trial.histograms)} or more of them with different parts lists"
    if whole_share >= MIN_WHOLE_SHARE and not trial.by_meaning:
        return f"{lists}; {whole_share:.0%} hold nearly a whole exemplar in one piece and look like it with more parts"
    return lists


def rounded_text(number: int) -> str:
    """Write a number with its one or two significant digits."""
    if number < 20:
        return str(number)
    digits = 10 ** (len(str(number)) - 1) if number < 100 else 10 ** (len(str(number)) - 2)
    return f"{round(number / digits) * digits:,}"
