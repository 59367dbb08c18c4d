"""Moves: what the rigid motions between two shapes let change places, one region at a time or several at once
(substructures §4.3.1).

The paper lists elementary replacements, for those of every subset of the regions are their compositions, exponentially
many (figure 6). So does the list here; compositions along one motion, which need no other part to move either, are
drawn from it. Where shapes have most in common, as the variants of a castle do, one region alone changes little.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from stages.shape.arrays import FloatArray
from stages.variations.substitution.substitute import Docked
from stages.variations.substructures.ordered_graph import OrderedGraph

COMPOSED = 16
"""Compositions that are drawn along a motion for each region that it leaves over, if there are so many."""


class RegionSwap(NamedTuple):
    """One replacement: what leaves the base, bool (n,); what comes of the giver, bool (m,); the part of the base that
    each part of the giver coincides with, int16 (m,), or -1; and what brings the giver there, float64 (4, 4)."""

    taken: np.ndarray
    piece: np.ndarray
    image: np.ndarray
    motion: FloatArray

    def docked(self, giver: OrderedGraph, poses: FloatArray) -> Docked:
        """The parts of the piece at its boundary, each with the part of the base that it docks to, and its own of the
        giver's `poses` (m, 4, 4)."""
        inner, outer = giver.tails, giver.tails[giver.twins]
        across = self.piece[inner] & (self.image[outer] >= 0)
        return [
            (part, int(self.image[other]), poses[part])
            for part, other in zip(inner[across].tolist(), outer[across].tolist(), strict=True)
        ]

    def left(self, base: OrderedGraph, poses: FloatArray) -> Docked:
        """The parts of the giver that lie upon parts of the base which lose a neighbour, each with the part it lies
        upon and its own of the giver's `poses` (m, 4, 4): where nothing comes, these show how it may end."""
        ends = base.tails[self.taken[base.tails[base.twins]] & ~self.taken[base.tails]]
        return [(int(part), int(self.image[part]), poses[part]) for part in np.flatnonzero(np.isin(self.image, ends))]


@dataclass(frozen=True)
class RegionSwaps:
    """Replacements of a piece of a base by one of a giver along q rigid motions.

    motions: float64 (q, 4, 4), bring the giver into the base; regions: int16 (q, n + m), for each part of the base and
    then of the giver the first part of the region that it is in, counted so, or -1 where it coincides with one of the
    other; images: int16 (q, m), the part of the base that each part of the giver coincides with, or -1; listed: int32
    (k, 2), motion and region of each replacement of one region; meetings: how often these are met from all pairs of
    equal parts and their symmetries, each of which would have to be tried if equivalent replacements were not factored
    out; work: how many parts were laid upon others; is_whole: whether these are all, or what came first until a limit
    was met.
    """

    motions: FloatArray
    regions: np.ndarray
    images: np.ndarray
    listed: np.ndarray
    meetings: int
    work: int
    is_whole: bool

    def __len__(self) -> int:
        return len(self.listed)

    def __getitem__(self, number: int) -> RegionSwap:
        motion, region = self.listed[number].tolist()
        return self.along(motion, np.arange(self.regions.shape[1]) == region)

    def order(self, rng: np.random.Generator) -> list[int]:
        """What to draw, in random order: the numbers of all that are listed, and, counted on from those, the number of
        each motion, once for each choice of some of its regions or, of many, some times for each region."""
        regions = (self.regions == np.arange(self.regions.shape[1])).sum(axis=1)
        again = np.minimum(2 ** np.minimum(regions, 16) - 2 - regions, COMPOSED * regions)
        composed = len(self) + np.repeat(np.arange(len(regions)), again)
        numbers: list[int] = rng.permutation(np.concatenate([np.arange(len(self)), composed])).tolist()
        return numbers

    def draw(self, rng: np.random.Generator, number: int) -> tuple[int, np.ndarray]:
        """The motion, and by their numbers the regions, bool (n + m,), of that number of `order`: the one of a listed
        replacement, or a random choice of those along a motion."""
        parts = self.regions.shape[1]
        if number >= len(self):
            return number - len(self), np.less(rng.random(parts), 0.5)
        motion, region = self.listed[number].tolist()
        return motion, np.equal(np.arange(parts), region)

    def along(self, motion: int, chosen: np.ndarray) -> RegionSwap:
        """The replacement of the chosen regions, bool (n + m,), along a motion; it may be of none or of all."""
        regions, parts = self.regions[motion], self.regions.shape[1] - self.images.shape[1]
        inside: np.ndarray = (regions >= 0) & chosen[regions]
        return RegionSwap(inside[:parts], inside[parts:], self.images[motion], self.motions[motion])
