"""The MAP-Elites archive: a grid over the features of variants, with counts of its cells and of type histograms.

It tells which parents are rare and which variants are new (quality-diversity search).
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence

import numpy as np

from stages.shape.arrays import Float32Array
from stages.variations.novelty.features import AXES, Axis

Cell = tuple[int, ...]

Place = tuple[int, int]
"""Numbers of a variant's cell and of its histogram, in the order in which they were first seen."""

_SHARES = ("mixture", "neighbourhood_mixture", "distance", "copied_share")


def cell_of_features(features: Float32Array, axes: Sequence[Axis], resolution: int) -> Cell:
    """Return the cell of features float32 (10,).

    Sizes are binned by octaves, shares in equal steps with 0 apart; the dominant type is its own bin.
    """
    cell = []
    for axis in axes:
        value = float(features[AXES.index(axis)])
        if axis == "dominant":
            cell.append(int(value))
        elif axis in _SHARES:
            cell.append(int(np.ceil(4 * resolution * value - 1e-6)))
        else:
            # The small addition puts sizes that differ only by rounding into one cell.
            cell.append(int(np.floor(resolution * np.log2(value + (axis == "cycle_rank")) + 1e-3)) if value > 0 else 0)
    return tuple(cell)


class Archive:
    """Counts of variants by cell and by histogram."""

    def __init__(self, cell_quota: int) -> None:
        self.cell_quota = cell_quota
        self._cells, self._histograms = _Tally(), _Tally()

    def add(self, cell: Cell, histogram: int) -> Place:
        """Count one variant with the hash `histogram` of its type histogram; return its place."""
        return self._cells.add(cell), self._histograms.add(histogram)

    def crowds(self, places: np.ndarray) -> np.ndarray:
        """Return how common the variants at k places int (k, 2) are, int64 (k,), small numbers for rare ones."""
        crowds: np.ndarray = self._cells.counts[places[:, 0]] * self._histograms.counts[places[:, 1]]
        return crowds

    def has_histogram(self, histogram: int) -> bool:
        """Return whether a variant with this histogram was counted."""
        return histogram in self._histograms.numbers

    def is_full(self, cell: Cell, histogram: int) -> bool:
        """Return whether the histogram is known and the cell has its quota."""
        number = self._cells.numbers.get(cell)
        return self.has_histogram(histogram) and number is not None and self._cells.counts[number] >= self.cell_quota


class _Tally:
    """Things, numbered in the order in which they were first seen, with their counts."""

    def __init__(self) -> None:
        self.numbers: dict[Hashable, int] = {}
        self.counts = np.zeros(1024, dtype=np.int64)

    def add(self, thing: Hashable) -> int:
        number = self.numbers.setdefault(thing, len(self.numbers))
        if number == len(self.counts):
            self.counts = np.concatenate([self.counts, np.zeros_like(self.counts)])
        self.counts[number] += 1
        return number
