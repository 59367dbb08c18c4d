"""What a run will come to, from a short search of the kit that it will build: numbers, and a sentence for people."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.randomness import decision_rng
from stages.autoconfig.bared import bared
from stages.autoconfig.ladder import FEW, is_dull
from stages.autoconfig.probe import Finds, Probe
from stages.shape.geometry.contact_oracle import ContactAnswers
from stages.shape.graphs.patterns import observed_patterns, seen_once
from stages.shape.kit import Kit
from stages.variations.report.advice import another_model, what_keeps
from stages.variations.search.search import DUPLICATE, Variant

MANY = 300
"""The search for a forecast ends at so many distinct graphs."""
LISTS = 50
"""With fewer parts lists than this a dataset of MANY shapes has each of them many times."""
LOOK = "look at the sheet before you make many"
NAMED = 2
"""So many labels are named in a sentence."""
LONG = 4
"""It has so many times the tries of a probe, as long as it finds something in the first."""


@dataclass(frozen=True)
class Forecast:
    """What a short search of a kit found, and what it says of a long one.

    layouts: about how many distinct graphs there are, None where the end is not in sight; parts: fewest and most parts
    of the finds; seen_once: share of parts whose pattern occurs once; sentence: what to expect, mend; variants: the
    finds; chosen: those that differ most, most different first; bared: the labels whose parts lose what stands close
    above or below them.
    """

    finds: Finds
    layouts: int | None
    parts: tuple[int, int]
    seen_once: float
    sentence: str
    variants: Sequence[Variant]
    bared: tuple[str, ...] = ()

    @property
    def is_poor(self) -> bool:
        """Whether it is no dataset: next to nothing, or all of it alike, or broken."""
        few = not self.finds.graphs or (self.layouts is not None and self.layouts < FEW)
        return few or is_dull(self.finds) or bool(self.bared)

    @property
    def chosen(self) -> list[Variant]:
        """The most different finds."""
        return [self.variants[place] for place in self.finds.most_different]


def forecast(
    kit: Kit, answers: ContactAnswers, tries: int, known: int = 0, hubs: float = 0, copied: float = 1.0
) -> Forecast:
    """Search a kit for a little while. `answers` are those of `kit`; what is random depends on the kit alone. `known`:
    how many graphs a probe has found in it: where there are any, a first search in vain is no answer; `hubs`, `copied`:
    as for Probe, for what will be refused does not count."""
    probe = Probe(answers, decision_rng(0, "choices", "forecast"), hubs, copied)
    finds = probe.go_on(tries, MANY, evenly=True)
    if finds.graphs or known:
        finds = probe.go_on((LONG - 1) * tries, MANY, evenly=True)
    layouts = _layouts(finds)
    sizes = [len(each.assembly) for each in probe.variants]
    parts = (min(sizes, default=0), max(sizes, default=0))
    once = seen_once(observed_patterns(kit, answers.dockings, upright=True))
    broken = bared(kit, [probe.whole(place) for place in finds.most_different])
    said = _sentence(kit, finds, layouts, parts, broken)
    return Forecast(finds, layouts, parts, once, said, probe.variants, broken)


def _layouts(finds: Finds) -> int | None:
    """About how many distinct graphs there are, from how often the search found what it had: n finds of which g differ
    are to be expected of N equally likely ones where N (1 - exp(-n / N)) = g. None where few came twice."""
    graphs, again = finds.graphs, finds.rejects.get(DUPLICATE, 0)
    if graphs == 0:
        return 0
    if graphs >= MANY or again < graphs:
        return None
    low, high = float(graphs), 1e6
    while high / low > 1.01:
        middle = (low * high) ** 0.5
        low, high = (middle, high) if middle * -np.expm1(-(graphs + again) / middle) < graphs else (low, middle)
    return round(low)


def _sentence(kit: Kit, finds: Finds, layouts: int | None, parts: tuple[int, int], broken: tuple[str, ...] = ()) -> str:
    if not finds.graphs:
        return f"nothing: {what_keeps(kit, finds.rejects, finds.tries)}"
    size = f"{parts[0]} to {parts[1]} parts" if parts[0] < parts[1] else f"{parts[0]} parts each"
    count = "hundreds of layouts" if layouts is None else f"about {rounded(layouts)} layout{'s'[: layouts != 1]}"
    if layouts is not None and layouts < FEW:
        return f"{count}, no dataset: {what_keeps(kit, finds.rejects, finds.tries)}"
    if layouts is not None:  # at least: some are far rarer than others, and a long search builds on what it found
        count = f"{rounded(layouts)} or more layouts"
    if broken:
        names = " and ".join(broken[:NAMED]) + (" and others" if len(broken) > NAMED else "")
        why = f"nothing stands close above or below {names}, as it does in the exemplar"
        return f"{count} of {size} that look broken, for {why}; {LOOK}, and bring {another_model(kit)}"
    if is_dull(finds):
        alike = "like the exemplar" if finds.spread >= finds.distance else "like each other"
        return f"{count} of {size} that look {alike}; {LOOK}, and bring {another_model(kit)}"
    if finds.histograms < LISTS and not finds.by_meaning:
        few = f"about {rounded(finds.histograms)} parts lists, so that many will look alike"
        return f"{count} of {size}, but only of {few}; {LOOK}, and bring {another_model(kit)}"
    return f"{count} of {size}, {rounded(finds.histograms)} or more of them of different parts lists"


def rounded(number: int) -> str:
    """A number with one or two digits that mean something."""
    if number < 20:
        return str(number)
    digits = 10 ** (len(str(number)) - 1) if number < 100 else 10 ** (len(str(number)) - 2)
    return f"{round(number / digits) * digits:,}"
