"""The ladder: settings from the strictest on, each probed, until one gives enough."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.randomness import decision_rng
from stages.autoconfig.contact_analysis import ContactAnalysis, Setting
from stages.autoconfig.lost_support import lost_support
from stages.autoconfig.trial_search import MAX_GROWTH_DEGREE, TrialResult, TrialSearch
from stages.shape.geometry.contact_oracle import ContactOracle
from stages.shape.graphs.neighbourhoods import SLOT_LEVELS
from stages.shape.kit import Assembly, ContactKind, Strictness
from stages.shape.resolved_settings import RESOLVED_HUB_SHARE
from stages.variations.novelty.copied_pieces import CopyDetector
from stages.variations.novelty.low_diversity import NEAR_COPY_SHARE

SUFFICIENT_GRAPHS = 80
"""So many distinct graphs in a probe promise hundreds in a search."""
SUFFICIENT_HISTOGRAMS = 16
MIN_EXEMPLAR_DISTANCE = 0.05
MIN_PAIR_DISTANCE = 0.03
"""Of so many histograms, so far from the exemplars and from each other, is a pool that is not dull."""
MIN_NON_COPY_RATE = 0.25
"""Share of finds that are no near copies from which on a search that refuses the others still comes to an end."""
MIN_SEEN_FILLINGS_SHARE = 0.85
"""Share of parts with fillings as seen below which a grammar of slots is too loose for a kit."""
MIN_USEFUL_GRAPHS = 20
"""Fewer graphs than this are next to nothing."""
PROMISING_HISTOGRAMS = 10
"""A setting that gave so many histograms in the first tries gets more of them; by meaning, where finds build on each
other, one that gave any."""
EXTENDED_TRIES_FACTOR = 4
"""As many times the tries, for a setting that looks promising."""
MIN_KEPT_SHARE = 0.6
"""Share of the parts that must stay where some are left out."""
MAX_PART_TRIES = 8_000_000
"""Tries times parts after which no more are tried but slots: a try takes the longer the more parts there are."""
MAX_HUB_TYPES = 4
"""Most types of hubs that are peeled off."""
CANDIDATE_GRAMMARS: tuple[Strictness, ...] = ("multiset", "count_and_pairs", *SLOT_LEVELS)
CANDIDATE_KINDS: tuple[tuple[ContactKind, ...], ...] = (("point", "line", "face"), ("line", "face"), ("face",))


@dataclass(frozen=True)
class SearchSpace:
    """What the ladder may not leave: the kinds, grammars and hubs to choose from; hubs None where it may peel.
    largest: whether exemplars may lose what falls apart from their largest piece."""

    kinds: tuple[tuple[ContactKind, ...], ...] = CANDIDATE_KINDS
    grammars: tuple[Strictness, ...] = CANDIDATE_GRAMMARS
    hubs: tuple[int, ...] | None = None
    largest: bool = True


@dataclass(frozen=True)
class CandidateSetting:
    """A setting, what a probe found under it, and the share of all parts that stay; different: the most different
    finds, with their hubs where they are left out; bared: the labels whose parts lose what stands close above or below
    them in these."""

    setting: Setting
    finds: TrialResult
    kept: float
    different: Sequence[Assembly] = ()
    lost_support: tuple[str, ...] = ()

    @property
    def score(self) -> tuple[float, ...]:
        """By which rungs that give too little are compared: histograms at their distances, in what is left of the
        exemplars; then graphs. For next to nothing no hubs are left out. What looks broken is hardly worth more than
        nothing."""
        finds, kept = self.finds, self.kept
        if (self.setting.hubs and finds.graphs < MIN_USEFUL_GRAPHS) or finds.observed_share < MIN_SEEN_FILLINGS_SHARE:
            return (0.0, 0.0)
        if self.lost_support:
            return (0.0, finds.graphs * kept)
        return (finds.histograms * min(finds.distance, 0.2) * min(finds.spread, 0.2) * kept, finds.graphs * kept)

    @property
    def gives_enough(self) -> bool:
        """Whether it promises a pool of some size that is not dull, nor broken."""
        finds = self.finds
        return (
            finds.graphs >= SUFFICIENT_GRAPHS
            and finds.histograms >= SUFFICIENT_HISTOGRAMS
            and finds.observed_share >= MIN_SEEN_FILLINGS_SHARE
            and not has_low_diversity(finds)
            and not self.lost_support
        )


def has_low_diversity(finds: TrialResult) -> bool:
    """Whether finds look like an exemplar, or like each other; near copies do no harm where enough are none, for then
    they are refused, nor by meaning."""
    copies = finds.copied >= NEAR_COPY_SHARE and finds.telling < MIN_NON_COPY_RATE and not finds.by_meaning
    return finds.distance < MIN_EXEMPLAR_DISTANCE or finds.spread < MIN_PAIR_DISTANCE or copies


def parts_without_hubs(sight: ContactAnalysis, hubs: tuple[int, ...]) -> int:
    """How many parts of all models stay, each model's in one piece, without those of the types `hubs`."""
    return sum(map(len, sight.staying(Setting(CANDIDATE_KINDS[0], CANDIDATE_GRAMMARS[0], hubs))))


def search_settings(sight: ContactAnalysis, rails: SearchSpace, tries: int) -> list[CandidateSetting]:
    """The rungs that were tried, the chosen one last.

    Chosen is the first that gives enough; where none does, the one of the best score, the stricter one of equals.
    Each has `tries` by each method, and more if it looks promising; after so much WORK none but slots are tried. A
    level of slots admits nothing that the loosest of them does not: where that finds next to nothing it is the only
    one that is tried.
    """
    tried: list[CandidateSetting] = []
    known: dict[tuple[ContactKind, ...], ContactOracle] = {}
    copies: dict[Setting, CopyDetector] = {}
    looked: dict[Setting, CandidateSetting | None] = {}

    def look(setting: Setting) -> CandidateSetting | None:
        """The rung of a setting; None where too little of the models stays."""
        staying = sight.staying(setting)
        kept = sum(map(len, staying)) / sight.parts
        if min(map(len, staying)) < 2 or (kept < 1.0 and (not rails.largest or (tried and kept < MIN_KEPT_SHARE))):
            return None
        kit = sight.kit(setting)
        if setting.kinds not in known:
            known[setting.kinds] = ContactOracle(kit)
        answers = known[setting.kinds].under(kit)
        any_grammar = replace(setting, grammar=CANDIDATE_GRAMMARS[0])
        if any_grammar not in copies:
            copies[any_grammar] = CopyDetector(kit, answers.dockings)
        return _rung(answers, setting, tries, kept, 1 if rails.hubs else RESOLVED_HUB_SHARE, copies[any_grammar])

    for setting in _settings(sight, rails):
        if setting.grammar not in SLOT_LEVELS:
            if sum(each.finds.tries for each in tried) * sight.parts > MAX_PART_TRIES:
                continue
        else:
            loosest = replace(setting, grammar=rails.grammars[-1])
            if loosest not in looked:
                looked[loosest] = look(loosest)
            found = looked[loosest]
            if setting != loosest and (found is None or found.finds.histograms < PROMISING_HISTOGRAMS):
                continue
        rung = looked[setting] if setting in looked else look(setting)
        if rung is None:
            continue
        tried.append(rung)
        if rung.gives_enough:
            return tried
    if tried:
        best = max(range(len(tried)), key=lambda place: (tried[place].score, -place))
        tried.append(tried.pop(best))
    return tried


def _rung(
    answers: ContactOracle, setting: Setting, tries: int, kept: float, required: float, copies: CopyDetector
) -> CandidateSetting:
    """The first tries, and more where they found something that differs. Where hubs are left out, finds must get back
    those that are `required` of a variant. `copies`: as for Search."""
    names = [answers.kit.types[index].name for index in setting.hubs]
    rng = decision_rng(0, "choices", setting.grammar, *setting.kinds, *names)
    probe = TrialSearch(answers, rng, required if setting.hubs else 0, copies=copies)
    rung = _looked_at(CandidateSetting(setting, probe.go_on(tries, SUFFICIENT_GRAPHS, evenly=True), kept), probe)
    promising = rung.finds.histograms >= (1 if rung.finds.by_meaning else PROMISING_HISTOGRAMS)
    if promising and not rung.gives_enough and not rung.lost_support:
        more = probe.go_on((EXTENDED_TRIES_FACTOR - 1) * tries, EXTENDED_TRIES_FACTOR * SUFFICIENT_GRAPHS, evenly=True)
        rung = _looked_at(CandidateSetting(setting, more, kept), probe)
    return rung


def _looked_at(rung: CandidateSetting, probe: TrialSearch) -> CandidateSetting:
    """A rung with the most different finds of its probe, and what is bared in them."""
    different = [probe.whole(place) for place in rung.finds.most_different]
    return replace(rung, different=different, lost_support=lost_support(probe.kit, different))


def _settings(sight: ContactAnalysis, rails: SearchSpace) -> Iterator[Setting]:
    """Settings, the strictest first, slots last of all; those that differ in nothing that the models have are one."""
    different: dict[tuple[ContactKind, ...], tuple[ContactKind, ...]] = {}
    for kinds in rails.kinds:
        there = tuple(kind for kind in kinds if kind in sight.kinds)
        if there:
            different.setdefault(there, kinds)
    counted = [each for each in rails.grammars if each not in SLOT_LEVELS]
    for hubs in _hubs(sight, rails):
        yield from (Setting(kinds, each, hubs) for kinds in different.values() for each in counted)
    hubs = rails.hubs or ()
    edges = sight.counted(Setting(CANDIDATE_KINDS[0], CANDIDATE_GRAMMARS[0], hubs))
    widest = max(int(np.bincount(each.edges.ravel(), minlength=1).max()) for each in edges)
    slots = [each for each in rails.grammars if each in SLOT_LEVELS and widest <= MAX_GROWTH_DEGREE]
    yield from (Setting(kinds, each, hubs) for kinds in different.values() for each in slots)


def _hubs(sight: ContactAnalysis, rails: SearchSpace) -> Iterator[tuple[int, ...]]:
    """None, then one type more at a time, of the part that touches most; as long as most parts stay."""
    if rails.hubs is not None:
        yield rails.hubs
        return
    hubs: tuple[int, ...] = ()
    yield hubs
    for _ in range(MAX_HUB_TYPES):
        widest = sight.widest(hubs)
        if widest is None:
            return
        hubs = tuple(sorted((*hubs, widest)))
        if parts_without_hubs(sight, hubs) < MIN_KEPT_SHARE * sight.parts:
            return
        yield hubs
