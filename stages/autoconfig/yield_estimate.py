"""What a run will come to, from a short search of the kit that it will build: numbers, and a sentence for people."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.randomness import decision_rng
from stages.autoconfig.lost_support import lost_support
from stages.autoconfig.setting_search import MIN_USEFUL_GRAPHS, has_low_diversity
from stages.autoconfig.trial_search import TrialResult, TrialSearch
from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.graphs.patterns import observed_patterns, unique_pattern_share
from stages.shape.kit import Kit
from stages.variations.report.advice import another_model, what_keeps
from stages.variations.search.search import DUPLICATE, Variant

MAX_ESTIMATE_GRAPHS = 300
"""The search for a forecast ends at so many distinct graphs."""
MIN_PARTS_LISTS = 50
"""With fewer parts lists than this a dataset of MANY shapes has each of them many times."""
LOOK_FIRST = "look at the sheet before you make many"
MAX_LABELS_SHOWN = 2
"""So many labels are named in a sentence."""
ESTIMATE_TRIES_FACTOR = 4
"""It has so many times the tries of a probe, as long as it finds something in the first."""


@dataclass(frozen=True)
class YieldEstimate:
    """What a short search of a kit found, and what it says of a long one.

    layouts: about how many distinct graphs there are, None where the end is not in sight; parts: fewest and most parts
    of the finds; seen_once: share of parts whose pattern occurs once; sentence: what to expect, mend; variants: the
    finds; chosen: those that differ most, most different first; bared: the labels whose parts lose what stands close
    above or below them.
    """

    finds: TrialResult
    layouts: int | None
    parts: tuple[int, int]
    unique_pattern_share: float
    sentence: str
    variants: Sequence[Variant]
    lost_support: tuple[str, ...] = ()

    @property
    def is_poor(self) -> bool:
        """Whether it is no dataset: next to nothing, or all of it alike, or broken."""
        few = not self.finds.graphs or (self.layouts is not None and self.layouts < MIN_USEFUL_GRAPHS)
        return few or has_low_diversity(self.finds) or bool(self.lost_support)

    @property
    def chosen(self) -> list[Variant]:
        """The most different finds."""
        return [self.variants[place] for place in self.finds.most_different]


def estimate_yield(
    kit: Kit, answers: ContactOracle, tries: int, known: int = 0, hubs: float = 0, copied: float = 1.0
) -> YieldEstimate:
    """Search a kit for a little while. `answers` are those of `kit`; what is random depends on the kit alone. `known`:
    how many graphs a probe has found in it: where there are any, a first search in vain is no answer; `hubs`, `copied`:
    as for Probe, for what will be refused does not count."""
    probe = TrialSearch(answers, decision_rng(0, "choices", "forecast"), hubs, copied)
    finds = probe.go_on(tries, MAX_ESTIMATE_GRAPHS, evenly=True)
    if finds.graphs or known:
        finds = probe.go_on((ESTIMATE_TRIES_FACTOR - 1) * tries, MAX_ESTIMATE_GRAPHS, evenly=True)
    layouts = _layouts(finds)
    sizes = [len(each.assembly) for each in probe.variants]
    parts = (min(sizes, default=0), max(sizes, default=0))
    once = unique_pattern_share(observed_patterns(kit, answers.dockings, upright=True))
    broken = lost_support(kit, [probe.whole(place) for place in finds.most_different])
    said = _sentence(kit, finds, layouts, parts, broken)
    return YieldEstimate(finds, layouts, parts, once, said, probe.variants, broken)


def _layouts(finds: TrialResult) -> int | None:
    """About how many distinct graphs there are, from how often the search found what it had: n finds of which g differ
    are to be expected of N equally likely ones where N (1 - exp(-n / N)) = g. None where few came twice."""
    graphs, again = finds.graphs, finds.rejects.get(DUPLICATE, 0)
    if graphs == 0:
        return 0
    if graphs >= MAX_ESTIMATE_GRAPHS or again < graphs:
        return None
    low, high = float(graphs), 1e6
    while high / low > 1.01:
        middle = (low * high) ** 0.5
        low, high = (middle, high) if middle * -np.expm1(-(graphs + again) / middle) < graphs else (low, middle)
    return round(low)


def _sentence(
    kit: Kit, finds: TrialResult, layouts: int | None, parts: tuple[int, int], broken: tuple[str, ...] = ()
) -> str:
    if not finds.graphs:
        return f"nothing: {what_keeps(kit, finds.rejects, finds.tries)}"
    size = f"{parts[0]} to {parts[1]} parts" if parts[0] < parts[1] else f"{parts[0]} parts each"
    count = "hundreds of layouts" if layouts is None else f"about {rounded_text(layouts)} layout{'s'[: layouts != 1]}"
    if layouts is not None and layouts < MIN_USEFUL_GRAPHS:
        return f"{count}, no dataset: {what_keeps(kit, finds.rejects, finds.tries)}"
    if layouts is not None:  # at least: some are far rarer than others, and a long search builds on what it found
        count = f"{rounded_text(layouts)} or more layouts"
    if broken:
        names = " and ".join(broken[:MAX_LABELS_SHOWN]) + (" and others" if len(broken) > MAX_LABELS_SHOWN else "")
        why = f"nothing stands close above or below {names}, as it does in the exemplar"
        return f"{count} of {size} that look broken, for {why}; {LOOK_FIRST}, and bring {another_model(kit)}"
    if has_low_diversity(finds):
        alike = "like the exemplar" if finds.spread >= finds.distance else "like each other"
        return f"{count} of {size} that look {alike}; {LOOK_FIRST}, and bring {another_model(kit)}"
    if finds.histograms < MIN_PARTS_LISTS and not finds.by_meaning:
        few = f"about {rounded_text(finds.histograms)} parts lists, so that many will look alike"
        return f"{count} of {size}, but only of {few}; {LOOK_FIRST}, and bring {another_model(kit)}"
    return f"{count} of {size}, {rounded_text(finds.histograms)} or more of them of different parts lists"


def rounded_text(number: int) -> str:
    """A number with one or two digits that mean something."""
    if number < 20:
        return str(number)
    digits = 10 ** (len(str(number)) - 1) if number < 100 else 10 ** (len(str(number)) - 2)
    return f"{round(number / digits) * digits:,}"
