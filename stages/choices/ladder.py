"""The ladder: settings from the strictest on, each probed, until one gives enough."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from pipeline.randomness import decision_rng
from stages.choices.probe import Finds, Probe
from stages.choices.sight import Setting, Sight
from stages.shape.kit import ContactKind, Strictness
from stages.variations.kernels.answers import ContactAnswers

__all__ = ["Rails", "Rung", "climb", "gives_enough", "is_dull"]

GRAPHS = 80
"""So many distinct graphs in a probe promise hundreds in a search."""
HISTOGRAMS = 16
DISTANCE = 0.05
SPREAD = 0.03
"""Of so many histograms, so far from the exemplars and from each other, is a pool that is not dull."""
PROMISING = 4
"""A setting that gave so many graphs in the first tries gets more of them."""
LONGER = 4
"""As many times the tries, for a setting that looks promising."""
STAY = 0.6
"""Share of the parts that must stay where some are left out."""
PEELED = 4
"""Most types of hubs that are peeled off."""
GRAMMARS: tuple[Strictness, ...] = ("multiset", "count_and_pairs")
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
    """A setting, what a probe found under it, and the share of all parts that stay."""

    setting: Setting
    finds: Finds
    kept: float

    @property
    def score(self) -> tuple[float, ...]:
        """By which rungs that give too little are compared: histograms at their distance, in what is left of the
        exemplars; then graphs."""
        finds = self.finds
        apart = min(finds.distance, 0.2) * min(finds.spread, 0.2)
        return (finds.histograms * apart * self.kept, finds.graphs * self.kept)


def gives_enough(finds: Finds) -> bool:
    """Whether a probe promises a pool of some size that is not dull."""
    return finds.graphs >= GRAPHS and finds.histograms >= HISTOGRAMS and not is_dull(finds)


def is_dull(finds: Finds) -> bool:
    """Whether the most different finds look like an exemplar, or like each other."""
    return finds.distance < DISTANCE or finds.spread < SPREAD


def climb(sight: Sight, rails: Rails, tries: int) -> list[Rung]:
    """The rungs that were tried, the chosen one last.

    Chosen is the first that gives enough; where none does, the one of the best score, the stricter one of equals.
    """
    tried: list[Rung] = []
    known: dict[tuple[ContactKind, ...], ContactAnswers] = {}
    for setting in _settings(sight, rails):
        kit = sight.kit(setting)
        kept = sum(len(each.assembly) for each in kit.exemplars) / sight.parts
        if kept < 1.0 and (not rails.largest or (tried and kept < STAY)):
            continue
        if min(len(each.assembly) for each in kit.exemplars) < 2:
            continue
        if setting.kinds not in known:
            known[setting.kinds] = ContactAnswers(kit)
        answers = known[setting.kinds].under(kit)
        rung = Rung(setting, _probed(answers, setting, tries), kept)
        tried.append(rung)
        if gives_enough(rung.finds):
            return tried
    if tried:
        best = max(range(len(tried)), key=lambda place: (tried[place].score, -place))
        tried.append(tried.pop(best))
    return tried


def _probed(answers: ContactAnswers, setting: Setting, tries: int) -> Finds:
    """The first tries, and more where they found something."""
    names = [answers.kit.types[index].name for index in setting.hubs]
    probe = Probe(answers, decision_rng(0, "choices", setting.grammar, *setting.kinds, *names))
    finds = probe.go_on(tries, GRAPHS)
    if finds.graphs >= PROMISING and not gives_enough(finds):
        finds = probe.go_on((LONGER - 1) * tries, LONGER * GRAPHS)
    return finds


def _settings(sight: Sight, rails: Rails) -> Iterator[Setting]:
    """Settings, the strictest first; those that differ in nothing that the models have are one."""
    for hubs in _hubs(sight, rails):
        seen: set[tuple[ContactKind, ...]] = set()
        for kinds in rails.kinds:
            there = tuple(kind for kind in kinds if kind in sight.kinds)
            if there and there not in seen:
                seen.add(there)
                for grammar in rails.grammars:
                    yield Setting(kinds, grammar, hubs)


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
        if _left(sight, hubs) < STAY:
            return
        yield hubs


def _left(sight: Sight, hubs: Sequence[int]) -> float:
    kit = sight.kit(Setting(KINDS[0], GRAMMARS[0], tuple(hubs)))
    return sum(len(each.assembly) for each in kit.exemplars) / sight.parts
