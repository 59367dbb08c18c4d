"""The shapes that pieces are cut from and docked to: exemplars, and earlier variants by family."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stages.shape.arrays import FloatArray, IntArray
from stages.shape.kit import Assembly
from stages.variations.kernels.structs import ShapeTables
from stages.variations.novelty.archive import Archive, Place
from stages.variations.novelty.features import MIN_MIXTURE

RIVALS_DRAWN = 6
"""Variants drawn from the largest family; a new variant replaces the most crowded of them."""


@dataclass(frozen=True)
class Parent:
    """A shape that pieces are cut from and docked to."""

    name: str  # name of an exemplar, or of a variant in the pool
    assembly: Assembly
    labels: IntArray  # int32 (m, 2), directed docking labels of its edges
    tables: ShapeTables
    origins: np.ndarray  # int8 (n,), the exemplar that each part came from
    shares: FloatArray  # float64 (exemplars,), share of parts from each
    place: Place  # its place in the archive


class Parents:
    """The exemplars, which stay, and a limited number of variants, kept so that no family crowds out another.

    The offspring of each exemplar is a family; variants that mix exemplars are one more.
    """

    def __init__(self, exemplars: Sequence[Parent], max_variants: int) -> None:
        self.exemplars = list(exemplars)
        self.variants: list[Parent] = []
        self.places = np.zeros((max_variants, 2), dtype=np.int64)
        self.families = np.zeros(max_variants, dtype=np.int64)
        self.shares = np.zeros((max_variants, len(exemplars)))

    def adopt(self, rng: np.random.Generator, parent: Parent, archive: Archive) -> None:
        """Add a variant; at the limit it replaces the most crowded of some variants of the largest family."""
        number = len(self.variants)
        if number == len(self.places):
            members = np.flatnonzero(self.families == np.bincount(self.families).argmax())
            rivals = members[(rng.random(RIVALS_DRAWN) * len(members)).astype(np.int64)]
            number = int(rivals[archive.crowds(self.places[rivals]).argmax()])
            self.variants[number] = parent
        else:
            self.variants.append(parent)
        self.places[number] = parent.place
        mixed = 1.0 - parent.shares.max() >= MIN_MIXTURE
        self.families[number] = len(self.exemplars) if mixed else parent.shares.argmax()
        self.shares[number] = parent.shares

    def draw(self, rng: np.random.Generator, weights: FloatArray, count: int) -> list[Parent]:
        """Draw `count` variants with replacement, with chances in proportion to `weights` float64 (variants,)."""
        cumulated = weights.cumsum()
        numbers = np.searchsorted(cumulated, rng.random(count) * cumulated[-1], side="right")
        return [self.variants[number] for number in numbers.clip(0, len(cumulated) - 1).tolist()]
