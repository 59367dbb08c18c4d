"""What to try next: which parents and which way of cutting, learnt from what each has found so far.

A choice is a way of drawing parents together with a way of cutting. Each is tried now and then; most tries go to the
choices that have lately found most histograms for their work. Plain random parents are one of them, so the search
does what random search does where nothing else finds more.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from stages.shape.arrays import FloatArray
from stages.variations.kernels.structs import GROWN, JOINTS, MEANINGS, NOTHING, PLANES, REPLACED, UNITS
from stages.variations.novelty.archive import Archive
from stages.variations.search.parents import Parent, Parents
from stages.variations.settings import SearchConfig

CUTS = ((GROWN, False), (PLANES, False), (PLANES, True), (JOINTS, False), (UNITS, False))
"""Ways of cutting, and whether the piece must be large."""
PLAIN, RARE, FAMILY, CROSSED = range(4)
"""Ways of drawing parents: at random; rare ones likelier; rare ones of a random family; a rare one and, of some, that
of most other ancestry."""
CHOICES = tuple((draw, *cut) for draw, cut in product(range(4), CUTS))
SUBSTITUTIONS = tuple((draw, MEANINGS, False) for draw in range(4))
"""Choices beside these for kits whose types are told by meaning: no cut, but parts of some meanings."""
REPLACEMENTS = tuple((draw, REPLACED, False) for draw in range(4))
"""Choices for replacement: no cut either, but one of all pieces that can take each other's place."""
GROWTH = (PLAIN, NOTHING, False)
"""The last choice: no parents, but a shape grown from nothing."""
BATCH = 64
"""Tries that are planned at once."""
MEMORY = 4000.0
"""Tries after which what was learnt counts for a third."""
TRY_WORK = 1.5
"""What a try of the exchange costs on average."""
LEAST = 0.2
"""Least share of the work for either method."""
IN_VAIN = 5000.0
"""Growth that brings nothing for so much work has the least share from then on, until it does: a grown shape of a large
kit costs as much as thousands of exchanges, and what was learnt of it is forgotten between two of them."""
FIRST_GUESS = 100.0
"""What growing a shape costs, before any is grown."""
PARTNERS = 4
"""Variants of which the one of most other ancestry is taken."""


@dataclass(frozen=True)
class PlannedTry:
    """One try: its number among the choices, the parents, the way of cutting and whether the piece must be large."""

    number: int
    a: Parent
    b: Parent
    way: int
    large: bool


class OperatorSelector:
    """Plans tries in batches and learns from what they brought."""

    def __init__(self, config: SearchConfig, by_meaning: bool = False) -> None:
        self.config = config
        exchanged = (*CHOICES, *SUBSTITUTIONS) if by_meaning else CHOICES
        if config.method == "substructures":
            exchanged = REPLACEMENTS
        elif config.method == "all":
            exchanged = (*exchanged, *REPLACEMENTS)
        self._grows = config.method in ("both", "growth", "all")
        self.choices = (*exchanged, GROWTH) if self._grows else exchanged
        self._exchanged = len(exchanged)
        self._gains = np.zeros(len(self.choices))
        self._work = np.zeros(len(self.choices))
        self._grown_work, self._grown, self._grown_gain = FIRST_GUESS, 1, 0.0

    def plan(self, rng: np.random.Generator, parents: Parents, archive: Archive, count: int) -> list[PlannedTry]:
        """The next `count` tries."""
        if self.config.novelty.guided:
            odds = self._odds(len(parents.exemplars)).cumsum()
            last = int(np.flatnonzero(np.diff(odds, prepend=0.0))[-1])
            numbers = np.searchsorted(odds, rng.random(count) * odds[-1], side="right").clip(0, last)
        else:
            numbers = self._plain(rng, count)
        draws = np.array([self.choices[number][0] for number in numbers.tolist()])
        first = self._draw(rng, parents, archive, draws)
        second = self._draw(rng, parents, archive, np.where(draws == CROSSED, RARE, draws))
        crossed = np.flatnonzero(draws == CROSSED).tolist()
        for place in crossed:
            second[place] = self._stranger(rng, parents, first[place], second[place])
        self._gains *= np.exp(-count / MEMORY)
        self._work *= np.exp(-count / MEMORY)
        return [
            PlannedTry(number, a, a if self.choices[number][1] == UNITS else b, *self.choices[number][1:])
            for number, a, b in zip(numbers.tolist(), first, second, strict=True)
        ]

    def learn(self, choice: PlannedTry, gain: float, work: float) -> None:
        """What a try has brought, and what it cost."""
        self._gains[choice.number] += gain
        self._work[choice.number] += work
        if choice.way == NOTHING:
            self._grown_work += work
            self._grown += 1
            self._grown_gain += gain

    def _odds(self, exemplars: int) -> FloatArray:
        """How likely each choice is: of the exchange a share for all alike, the rest by the square of what it gains."""
        end = self._exchanged
        if self.config.method == "growth":
            only: FloatArray = np.eye(len(self.choices))[end]
            return only
        possible = np.array([exemplars > 1 or draw in (PLAIN, RARE) for draw, *_ in self.choices[:end]])
        rates = np.where(possible, (self._gains[:end] + 1.0) / (self._work[:end] + 50.0), 0.0) ** 2
        explored: FloatArray = self.config.novelty.exploration * possible / possible.sum()
        chances: FloatArray = explored + (1.0 - self.config.novelty.exploration) * rates / rates.sum()
        if not self._grows:
            return chances
        share = self._grown_share()
        return np.append(chances * (1.0 - share), share / self._cost())

    def _grown_share(self) -> float:
        """The share of the work that is given to growth: that of what it gains for its work, within limits."""
        if not self._grown_gain and self._grown_work > IN_VAIN:
            return LEAST
        gains, work = self._gains[: self._exchanged].sum(), self._work[: self._exchanged].sum()
        exchanged, grown = (gains + 1.0) / (work + 50.0), (self._gains[-1] + 1.0) / (self._work[-1] + 50.0)
        return float(np.clip(grown / (grown + exchanged), LEAST, 1.0 - LEAST))

    def _cost(self) -> float:
        """What growing a shape costs beside a try of the exchange."""
        return max(self._grown_work / self._grown / TRY_WORK, 1.0)

    def _plain(self, rng: np.random.Generator, count: int) -> np.ndarray:
        """Choices by no experience: growth gets half of the work where it is not the only method, and replacement a
        tenth of the other tries."""
        if self.config.method == "growth":
            return np.full(count, self._exchanged)
        if self.config.method == "substructures":
            return np.zeros(count, dtype=np.int64)
        numbers = np.where(rng.random(count) < self.config.growth_share, 0, 1)
        if self.config.method == "all":
            numbers[rng.random(count) < 0.1] = self._exchanged - len(REPLACEMENTS)
        if self._grows:
            numbers[rng.random(count) < 1.0 / (1.0 + self._cost())] = self._exchanged
        return numbers

    def _draw(self, rng: np.random.Generator, parents: Parents, archive: Archive, draws: np.ndarray) -> list[Parent]:
        """A parent for each of `draws`: an exemplar, or an earlier variant in the way that it says."""
        known, exemplars = len(parents.variants), parents.exemplars
        chosen = [exemplars[int(place)] for place in (rng.random(len(draws)) * len(exemplars)).tolist()]
        earlier = rng.random(len(draws)) >= self.config.exemplar_share
        families = (rng.random(len(draws)) * (len(exemplars) + 1)).astype(np.int64)
        if not known:
            return chosen
        family_of = parents.families[:known]
        rarity = 1.0 / archive.crowds(parents.places[:known])
        groups = [(draws == PLAIN, np.ones(known)), (np.isin(draws, (RARE, CROSSED)), rarity)]
        groups += [
            ((draws == FAMILY) & (families == family), np.where(family_of == family, rarity, 0.0))
            for family in range(len(exemplars) + 1)
        ]
        for wanted, weights in groups:
            places = np.flatnonzero(wanted & earlier).tolist()
            if places and weights.any():
                for place, parent in zip(places, parents.draw(rng, weights, len(places)), strict=True):
                    chosen[place] = parent
        return chosen

    def _stranger(self, rng: np.random.Generator, parents: Parents, a: Parent, b: Parent) -> Parent:
        """Of `b`, an exemplar and some variants the one that has least of the ancestry of `a`."""
        rivals = [b, parents.exemplars[int(rng.random() * len(parents.exemplars))]]
        if parents.variants:
            places = (rng.random(PARTNERS - 2) * len(parents.variants)).astype(np.int64).tolist()
            rivals += [parents.variants[place] for place in places]
        return min(rivals, key=lambda each: float(np.minimum(each.shares, a.shares).sum()))
