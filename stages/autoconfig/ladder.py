"""The ladder: settings from the strictest on, each probed, until one gives enough."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.randomness import decision_rng
from stages.autoconfig.bared import bared
from stages.autoconfig.probe import HUB, Finds, Probe
from stages.autoconfig.sight import Setting, Sight
from stages.shape.geometry.contact_oracle import ContactAnswers
from stages.shape.graphs.neighbourhoods import SLOT_LEVELS
from stages.shape.kit import Assembly, ContactKind, Strictness
from stages.variations.novelty.copied_pieces import CopyTest
from stages.variations.novelty.low_diversity import COPIED
from stages.variations.settings import CHOSEN_HUBS

GRAPHS = 80
"""So many distinct graphs in a probe promise hundreds in a search."""
HISTOGRAMS = 16
DISTANCE = 0.05
SPREAD = 0.03
"""Of so many histograms, so far from the exemplars and from each other, is a pool that is not dull."""
TELLING = 0.25
"""Share of finds that are no near copies from which on a search that refuses the others still comes to an end."""
FAMILIAR = 0.85
"""Share of parts with fillings as seen below which a grammar of slots is too loose for a kit."""
FEW = 20
"""Fewer graphs than this are next to nothing."""
PROMISING = 10
"""A setting that gave so many histograms in the first tries gets more of them; by meaning, where finds build on each
other, one that gave any."""
LONGER = 4
"""As many times the tries, for a setting that looks promising."""
STAY = 0.6
"""Share of the parts that must stay where some are left out."""
WORK = 8_000_000
"""Tries times parts after which no more are tried but slots: a try takes the longer the more parts there are."""
PEELED = 4
"""Most types of hubs that are peeled off."""
GRAMMARS: tuple[Strictness, ...] = ("multiset", "count_and_pairs", *SLOT_LEVELS)
KINDS: tuple[tuple[ContactKind, ...], ...] = (("point", "line", "face"), ("line", "face"), ("face",))


@dataclass(frozen=True)
class Rails:
    """What the ladder may not leave: the kinds, grammars and hubs to choose from; hubs None where it may peel.
    largest: whether exemplars may lose what falls apart from their largest piece."""

    kinds: tuple[tuple[ContactKind, ...], ...] = KINDS
    grammars: tuple[Strictness, ...] = GRAMMARS
    hubs: tuple[int, ...] | None = None
    largest: bool = True


@dataclass(frozen=True)
class Rung:
    """A setting, what a probe found under it, and the share of all parts that stay; different: the most different
    finds, with their hubs where they are left out; bared: the labels whose parts lose what stands close above or below
    them in these."""

    setting: Setting
    finds: Finds
    kept: float
    different: Sequence[Assembly] = ()
    bared: tuple[str, ...] = ()

    @property
    def score(self) -> tuple[float, ...]:
        """By which rungs that give too little are compared: histograms at their distances, in what is left of the
        exemplars; then graphs. For next to nothing no hubs are left out. What looks broken is hardly worth more than
        nothing."""
        finds, kept = self.finds, self.kept
        if (self.setting.hubs and finds.graphs < FEW) or finds.familiar < FAMILIAR:
            return (0.0, 0.0)
        if self.bared:
            return (0.0, finds.graphs * kept)
        return (finds.histograms * min(finds.distance, 0.2) * min(finds.spread, 0.2) * kept, finds.graphs * kept)

    @property
    def gives_enough(self) -> bool:
        """Whether it promises a pool of some size that is not dull, nor broken."""
        finds = self.finds
        return (
            finds.graphs >= GRAPHS
            and finds.histograms >= HISTOGRAMS
            and finds.familiar >= FAMILIAR
            and not is_dull(finds)
            and not self.bared
        )


def is_dull(finds: Finds) -> bool:
    """Whether finds look like an exemplar, or like each other; near copies do no harm where enough are none, for then
    they are refused, nor by meaning."""
    copies = finds.copied >= COPIED and finds.telling < TELLING and not finds.by_meaning
    return finds.distance < DISTANCE or finds.spread < SPREAD or copies


def peeled(sight: Sight, hubs: tuple[int, ...]) -> int:
    """How many parts of all models stay, each model's in one piece, without those of the types `hubs`."""
    return sum(map(len, sight.staying(Setting(KINDS[0], GRAMMARS[0], hubs))))


def climb(sight: Sight, rails: Rails, tries: int) -> list[Rung]:
    """The rungs that were tried, the chosen one last.

    Chosen is the first that gives enough; where none does, the one of the best score, the stricter one of equals.
    Each has `tries` by each method, and more if it looks promising; after so much WORK none but slots are tried. A
    level of slots admits nothing that the loosest of them does not: where that finds next to nothing it is the only
    one that is tried.
    """
    tried: list[Rung] = []
    known: dict[tuple[ContactKind, ...], ContactAnswers] = {}
    copies: dict[Setting, CopyTest] = {}
    looked: dict[Setting, Rung | None] = {}

    def look(setting: Setting) -> Rung | None:
        """The rung of a setting; None where too little of the models stays."""
        staying = sight.staying(setting)
        kept = sum(map(len, staying)) / sight.parts
        if min(map(len, staying)) < 2 or (kept < 1.0 and (not rails.largest or (tried and kept < STAY))):
            return None
        kit = sight.kit(setting)
        if setting.kinds not in known:
            known[setting.kinds] = ContactAnswers(kit)
        answers = known[setting.kinds].under(kit)
        any_grammar = replace(setting, grammar=GRAMMARS[0])
        if any_grammar not in copies:
            copies[any_grammar] = CopyTest(kit, answers.dockings)
        return _rung(answers, setting, tries, kept, 1 if rails.hubs else CHOSEN_HUBS, copies[any_grammar])

    for setting in _settings(sight, rails):
        if setting.grammar not in SLOT_LEVELS:
            if sum(each.finds.tries for each in tried) * sight.parts > WORK:
                continue
        else:
            loosest = replace(setting, grammar=rails.grammars[-1])
            if loosest not in looked:
                looked[loosest] = look(loosest)
            found = looked[loosest]
            if setting != loosest and (found is None or found.finds.histograms < PROMISING):
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
    answers: ContactAnswers, setting: Setting, tries: int, kept: float, required: float, copies: CopyTest
) -> Rung:
    """The first tries, and more where they found something that differs. Where hubs are left out, finds must get back
    those that are `required` of a variant. `copies`: as for Search."""
    names = [answers.kit.types[index].name for index in setting.hubs]
    rng = decision_rng(0, "choices", setting.grammar, *setting.kinds, *names)
    probe = Probe(answers, rng, required if setting.hubs else 0, copies=copies)
    rung = _looked_at(Rung(setting, probe.go_on(tries, GRAPHS, evenly=True), kept), probe)
    promising = rung.finds.histograms >= (1 if rung.finds.by_meaning else PROMISING)
    if promising and not rung.gives_enough and not rung.bared:
        more = probe.go_on((LONGER - 1) * tries, LONGER * GRAPHS, evenly=True)
        rung = _looked_at(Rung(setting, more, kept), probe)
    return rung


def _looked_at(rung: Rung, probe: Probe) -> Rung:
    """A rung with the most different finds of its probe, and what is bared in them."""
    different = [probe.whole(place) for place in rung.finds.most_different]
    return replace(rung, different=different, bared=bared(probe.kit, different))


def _settings(sight: Sight, rails: Rails) -> Iterator[Setting]:
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
    edges = sight.counted(Setting(KINDS[0], GRAMMARS[0], hubs))
    widest = max(int(np.bincount(each.edges.ravel(), minlength=1).max()) for each in edges)
    slots = [each for each in rails.grammars if each in SLOT_LEVELS and widest <= HUB]
    yield from (Setting(kinds, each, hubs) for kinds in different.values() for each in slots)


def _hubs(sight: Sight, rails: Rails) -> Iterator[tuple[int, ...]]:
    """None, then one type more at a time, of the part that touches most; as long as most parts stay."""
    if rails.hubs is not None:
        yield rails.hubs
        return
    hubs: tuple[int, ...] = ()
    yield hubs
    for _ in range(PEELED):
        widest = sight.widest(hubs)
        if widest is None:
            return
        hubs = tuple(sorted((*hubs, widest)))
        if peeled(sight, hubs) < STAY * sight.parts:
            return
        yield hubs
