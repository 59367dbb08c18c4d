"""Region swaps: what the alignments of two shapes allow to exchange, one region or several at once (substructures
§4.3.1).

The paper lists elementary replacements; those of subsets of the regions are their compositions, exponentially many
(figure 6). So does this list; compositions along one alignment, which move no other part either, are drawn from it.
Where shapes have most in common, as variants of a castle do, one region alone changes little.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from stages.shape.arrays import FloatArray
from stages.variations.substitution.substitute import Docked
from stages.variations.substructures.ordered_graph import OrderedGraph

MAX_COMPOSITIONS_PER_REGION = 16
"""Compositions that are drawn along an alignment for each region that it leaves over."""


class RegionSwap(NamedTuple):
    """One replacement along an alignment."""

    taken: np.ndarray  # bool (n,), what leaves the base
    piece: np.ndarray  # bool (m,), what comes of the giver
    image: np.ndarray  # int16 (m,), part of the base that each part of the giver coincides with, or -1
    transform: FloatArray  # float64 (4, 4), brings the giver to the base

    def docked(self, giver: OrderedGraph, poses: FloatArray) -> Docked:
        """Return the parts of the piece at its boundary, the part of the base that each docks to, and its pose in the
        giver.

        poses: float64 (m, 4, 4), of the giver
        """
        inner, outer = giver.tails, giver.tails[giver.twins]
        across = self.piece[inner] & (self.image[outer] >= 0)
        return [
            (part, int(self.image[image_part]), poses[part])
            for part, image_part in zip(inner[across].tolist(), outer[across].tolist(), strict=True)
        ]

    def ends(self, base: OrderedGraph, poses: FloatArray) -> Docked:
        """Return the same for parts of the giver that lie on parts of the base which lose a neighbour.

        Where nothing comes, these show that a shape can end there.
        """
        ends = base.tails[self.taken[base.tails[base.twins]] & ~self.taken[base.tails]]
        return [(int(part), int(self.image[part]), poses[part]) for part in np.flatnonzero(np.isin(self.image, ends))]


@dataclass(frozen=True)
class RegionSwaps:
    """Swaps of regions between a base and a giver along q alignments."""

    transforms: FloatArray  # float64 (q, 4, 4), bring the giver to the base
    regions: np.ndarray
    """int16 (q, n + m), first part of the region of each part of the base, then of the giver; -1 where it coincides."""
    images: np.ndarray  # int16 (q, m), part of the base that each part of the giver coincides with, or -1
    listed: np.ndarray  # int32 (k, 2), alignment and region of each swap of one region
    meetings: int
    """How often these are met from all pairs of equal parts and their symmetries: the tries without factoring out
    equivalent replacements."""
    work: int  # number of parts laid on others
    is_whole: bool  # whether the list is complete; otherwise a limit cut it short

    def __len__(self) -> int:
        return len(self.listed)

    def __getitem__(self, number: int) -> RegionSwap:
        alignment, region = self.listed[number].tolist()
        return self.along(alignment, np.arange(self.regions.shape[1]) == region)

    def order(self, rng: np.random.Generator) -> list[int]:
        """Return what to draw, in random order.

        These are the numbers of all listed swaps and, counted on from those, the number of each alignment, once for
        each subset of its regions or, of many, some times for each region.
        """
        regions = (self.regions == np.arange(self.regions.shape[1])).sum(axis=1)
        again = np.minimum(2 ** np.minimum(regions, 16) - 2 - regions, MAX_COMPOSITIONS_PER_REGION * regions)
        composed = len(self) + np.repeat(np.arange(len(regions)), again)
        numbers: list[int] = rng.permutation(np.concatenate([np.arange(len(self)), composed])).tolist()
        return numbers

    def draw(self, rng: np.random.Generator, number: int) -> tuple[int, np.ndarray]:
        """Return the alignment and the regions, bool (n + m,), of a number of `order`.

        They are the one region of a listed swap, or a random subset of the regions along an alignment.
        """
        parts = self.regions.shape[1]
        if number >= len(self):
            return number - len(self), np.less(rng.random(parts), 0.5)
        alignment, region = self.listed[number].tolist()
        return alignment, np.equal(np.arange(parts), region)

    def along(self, alignment: int, chosen: np.ndarray) -> RegionSwap:
        """Return the swap of the chosen regions, bool (n + m,), along an alignment; it may be of none or of all."""
        regions, parts = self.regions[alignment], self.regions.shape[1] - self.images.shape[1]
        inside: np.ndarray = (regions >= 0) & chosen[regions]
        return RegionSwap(inside[:parts], inside[parts:], self.images[alignment], self.transforms[alignment])
