"""Operator selection: which parents and which operator to try next, learnt from what each has found (a bandit).

A choice is a way of drawing parents together with an operator. Every choice is tried now and then; most tries go to the
choices that lately found most histograms for their work. Plain random parents are one of them, so the search does what
random search does where nothing else finds more.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from stages.shape.arrays import FloatArray
from stages.variations.kernels.operators import (
    GROWN_CUT,
    GROWTH,
    JOINT_CUT,
    PLANE_CUT,
    REPEATED_UNIT,
    REPLACEMENT,
    SUBSTITUTION,
)
from stages.variations.novelty.archive import Archive
from stages.variations.search.parents import Parent, Parents
from stages.variations.settings import SearchConfig

CUTS = ((GROWN_CUT, False), (PLANE_CUT, False), (PLANE_CUT, True), (JOINT_CUT, False), (REPEATED_UNIT, False))
"""Operators of the exchange, and whether the piece must be large."""
PLAIN, RARE, FAMILY, CROSSED = range(4)
"""Ways of drawing parents: at random; rare ones more often; rare ones of a random family; a rare one and, of some, the
one with most other ancestry."""
EXCHANGES = tuple((draw, *cut) for draw, cut in product(range(4), CUTS))
SUBSTITUTIONS = tuple((draw, SUBSTITUTION, False) for draw in range(4))
"""Further choices for kits with `types: meaning`."""
REPLACEMENTS = tuple((draw, REPLACEMENT, False) for draw in range(4))
GROWTH_CHOICE = (PLAIN, GROWTH, False)
"""The last choice: no parents."""
TRIES_PER_PLAN = 64
MEMORY_TRIES = 4000.0
"""Tries after which what was learnt counts for 1/e."""
TRY_WORK = 1.5
"""Average work of a try of the exchange."""
MIN_WORK_SHARE = 0.2
"""Smallest share of the work for growth, and for everything else."""
MAX_WORK_IN_VAIN = 5000.0
"""Work after which growth that has brought nothing gets MIN_WORK_SHARE. A grown shape of a large kit costs as much as
thousands of exchanges, and what was learnt of growth is forgotten between two of them."""
GROWTH_WORK_GUESS = 100.0
"""Assumed work of growing a shape before any is grown."""
PARTNERS_DRAWN = 4
"""Number of parents among which the one with most other ancestry is taken."""
UNGUIDED_REPLACEMENT_SHARE = 0.1


@dataclass(frozen=True)
class PlannedTry:
    """One try. number: index among the choices; a, b: parents; large: whether the piece must be large."""

    number: int
    a: Parent
    b: Parent
    operator: int
    large: bool


class OperatorSelector:
    """Plans tries in batches and learns from what they brought."""

    def __init__(self, config: SearchConfig, by_meaning: bool = False) -> None:
        self.config = config
        exchanged = (*EXCHANGES, *SUBSTITUTIONS) if by_meaning else EXCHANGES
        if config.method == "substructures":
            exchanged = REPLACEMENTS
        elif config.method == "all":
            exchanged = (*exchanged, *REPLACEMENTS)
        self._grows = config.method in ("both", "growth", "all")
        self.choices = (*exchanged, GROWTH_CHOICE) if self._grows else exchanged
        self._exchanged = len(exchanged)
        self._gains = np.zeros(len(self.choices))
        self._work = np.zeros(len(self.choices))
        self._grown_work, self._grown, self._grown_gain = GROWTH_WORK_GUESS, 1, 0.0

    def plan(self, rng: np.random.Generator, parents: Parents, archive: Archive, count: int) -> list[PlannedTry]:
        """Return the next `count` tries."""
        if self.config.novelty.guided:
            cumulated = self._chances(len(parents.exemplars)).cumsum()
            last = int(np.flatnonzero(np.diff(cumulated, prepend=0.0))[-1])
            numbers = np.searchsorted(cumulated, rng.random(count) * cumulated[-1], side="right").clip(0, last)
        else:
            numbers = self._unguided(rng, count)
        draws = np.array([self.choices[number][0] for number in numbers.tolist()])
        first = self._draw(rng, parents, archive, draws)
        second = self._draw(rng, parents, archive, np.where(draws == CROSSED, RARE, draws))
        for row in np.flatnonzero(draws == CROSSED).tolist():
            second[row] = self._stranger(rng, parents, first[row], second[row])
        self._gains *= np.exp(-count / MEMORY_TRIES)
        self._work *= np.exp(-count / MEMORY_TRIES)
        return [
            PlannedTry(number, a, a if self.choices[number][1] == REPEATED_UNIT else b, *self.choices[number][1:])
            for number, a, b in zip(numbers.tolist(), first, second, strict=True)
        ]

    def learn(self, planned: PlannedTry, gain: float, work: float) -> None:
        """Count what a try has brought and what it cost."""
        self._gains[planned.number] += gain
        self._work[planned.number] += work
        if planned.operator == GROWTH:
            self._grown_work += work
            self._grown += 1
            self._grown_gain += gain

    def _chances(self, exemplars: int) -> FloatArray:
        """Return the probability of each choice: an equal share for exploration, the rest by squared gain per work."""
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
        share = self._growth_share()
        return np.append(chances * (1.0 - share), share / self._relative_growth_work())

    def _growth_share(self) -> float:
        """Return the share of the work for growth: its share of all gain per work, within limits."""
        if not self._grown_gain and self._grown_work > MAX_WORK_IN_VAIN:
            return MIN_WORK_SHARE
        gains, work = self._gains[: self._exchanged].sum(), self._work[: self._exchanged].sum()
        exchanged, grown = (gains + 1.0) / (work + 50.0), (self._gains[-1] + 1.0) / (self._work[-1] + 50.0)
        return float(np.clip(grown / (grown + exchanged), MIN_WORK_SHARE, 1.0 - MIN_WORK_SHARE))

    def _relative_growth_work(self) -> float:
        """Return the work of growing a shape in tries of the exchange."""
        return max(self._grown_work / self._grown / TRY_WORK, 1.0)

    def _unguided(self, rng: np.random.Generator, count: int) -> np.ndarray:
        """Draw choices without experience.

        Growth gets half of the work unless it is the only method; replacement gets a tenth of the other tries.
        """
        if self.config.method == "growth":
            return np.full(count, self._exchanged)
        if self.config.method == "substructures":
            return np.zeros(count, dtype=np.int64)
        numbers = np.where(rng.random(count) < self.config.growth_share, 0, 1)
        if self.config.method == "all":
            numbers[rng.random(count) < UNGUIDED_REPLACEMENT_SHARE] = self._exchanged - len(REPLACEMENTS)
        if self._grows:
            numbers[rng.random(count) < 1.0 / (1.0 + self._relative_growth_work())] = self._exchanged
        return numbers

    def _draw(self, rng: np.random.Generator, parents: Parents, archive: Archive, draws: np.ndarray) -> list[Parent]:
        """Draw a parent for each of `draws`: an exemplar, or an earlier variant in that way."""
        known, exemplars = len(parents.variants), parents.exemplars
        chosen = [exemplars[int(number)] for number in (rng.random(len(draws)) * len(exemplars)).tolist()]
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
            rows = np.flatnonzero(wanted & earlier).tolist()
            if rows and weights.any():
                for row, parent in zip(rows, parents.draw(rng, weights, len(rows)), strict=True):
                    chosen[row] = parent
        return chosen

    def _stranger(self, rng: np.random.Generator, parents: Parents, a: Parent, b: Parent) -> Parent:
        """Return of `b`, an exemplar and some variants the one that shares least ancestry with `a`."""
        rivals = [b, parents.exemplars[int(rng.random() * len(parents.exemplars))]]
        if parents.variants:
            numbers = (rng.random(PARTNERS_DRAWN - 2) * len(parents.variants)).astype(np.int64).tolist()
            rivals += [parents.variants[number] for number in numbers]
        return min(rivals, key=lambda rival: float(np.minimum(rival.shares, a.shares).sum()))
