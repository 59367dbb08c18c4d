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

RIVALS = 6
"""Of so many variants of the largest family the most crowded makes room for another."""


@dataclass(frozen=True)
class Parent:
    """A shape that pieces are cut from and docked to; `name` is an exemplar's name or a variant's place in the pool.

    origins: int8 (n,), the exemplar that each part came from; shares: float64 (exemplars,) of them; place: where it
    stands in the archive.
    """

    name: str
    assembly: Assembly
    labels: IntArray
    tables: ShapeTables
    origins: np.ndarray
    shares: FloatArray
    place: Place


class Parents:
    """Exemplars, which stay, and at most `most` variants, kept so that no family crowds out another.

    The offspring of each exemplar is a family; those that mix material are one more.
    """

    def __init__(self, exemplars: Sequence[Parent], most: int) -> None:
        self.exemplars = list(exemplars)
        self.variants: list[Parent] = []
        self.places = np.zeros((most, 2), dtype=np.int64)
        self.families = np.zeros(most, dtype=np.int64)
        self.shares = np.zeros((most, len(exemplars)))

    def adopt(self, rng: np.random.Generator, parent: Parent, archive: Archive) -> None:
        """Add a variant; where there are as many as may be, the most crowded of some of the largest family leaves."""
        place = len(self.variants)
        if place == len(self.places):
            members = np.flatnonzero(self.families == np.bincount(self.families).argmax())
            rivals = members[(rng.random(RIVALS) * len(members)).astype(np.int64)]
            place = int(rivals[archive.crowds(self.places[rivals]).argmax()])
            self.variants[place] = parent
        else:
            self.variants.append(parent)
        self.places[place] = parent.place
        mixed = 1.0 - parent.shares.max() >= MIN_MIXTURE
        self.families[place] = len(self.exemplars) if mixed else parent.shares.argmax()
        self.shares[place] = parent.shares

    def draw(self, rng: np.random.Generator, weights: FloatArray, count: int) -> list[Parent]:
        """So many variants with replacement, with chances in proportion to `weights`, float64 (variants,)."""
        odds = weights.cumsum()
        drawn = np.searchsorted(odds, rng.random(count) * odds[-1], side="right").clip(0, len(odds) - 1)
        return [self.variants[place] for place in drawn.tolist()]
