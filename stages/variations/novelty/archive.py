"""The archive: a grid over the features of variants, with counts of its cells and of the type histograms.

It says which parents are rare, and which variants add to what is there (quality-diversity search).
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence

import numpy as np

from stages.shape.arrays import Float32Array
from stages.variations.novelty.features import AXES, Axis

Cell = tuple[int, ...]

Place = tuple[int, int]
"""Where a variant stands: the numbers of its cell and of its histogram, in the order in which they were first seen."""

_SHARES = ("mixture", "neighbourhood_mixture", "distance", "copied_share")


def cell_of(features: Float32Array, axes: Sequence[Axis], resolution: int) -> Cell:
    """The cell of features float32 (10,): sizes by octaves, shares in equal steps with 0 apart, the dominant type."""
    cell = []
    for axis in axes:
        value = float(features[AXES.index(axis)])
        if axis == "dominant":
            cell.append(int(value))
        elif axis in _SHARES:
            cell.append(int(np.ceil(4 * resolution * value - 1e-6)))
        else:
            # A hair is added so that sizes which are equal but for rounding share a cell.
            cell.append(int(np.floor(resolution * np.log2(value + (axis == "cycle_rank")) + 1e-3)) if value > 0 else 0)
    return tuple(cell)


class Archive:
    """How many variants there are of each cell and of each histogram."""

    def __init__(self, quota: int) -> None:
        self.cell_quota = quota
        self._cells, self._histograms = _Tally(), _Tally()

    def add(self, cell: Cell, histogram: int) -> Place:
        """Count one variant, `histogram` being a hash of its type histogram, and say where it stands."""
        return self._cells.add(cell), self._histograms.add(histogram)

    def crowds(self, places: np.ndarray) -> np.ndarray:
        """How common the variants at some places, int (k, 2), are, int64 (k,); the rarest have the least."""
        crowds: np.ndarray = self._cells.counts[places[:, 0]] * self._histograms.counts[places[:, 1]]
        return crowds

    def has_histogram(self, histogram: int) -> bool:
        """Whether a variant with this histogram was counted."""
        return histogram in self._histograms.numbers

    def is_full(self, cell: Cell, histogram: int) -> bool:
        """Whether the archive has enough of such variants: the histogram is known and the cell has its quota."""
        number = self._cells.numbers.get(cell)
        return self.has_histogram(histogram) and number is not None and self._cells.counts[number] >= self.cell_quota


class _Tally:
    """Things by the number under which they were first seen, and how often each was."""

    def __init__(self) -> None:
        self.numbers: dict[Hashable, int] = {}
        self.counts = np.zeros(1024, dtype=np.int64)

    def add(self, thing: Hashable) -> int:
        number = self.numbers.setdefault(thing, len(self.numbers))
        if number == len(self.counts):
            self.counts = np.concatenate([self.counts, np.zeros_like(self.counts)])
        self.counts[number] += 1
        return number
