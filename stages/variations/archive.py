"""The archive: a grid over the features of variants, with counts of its cells and of the type histograms.

It says which parents are rare, and which variants the pool has enough of (quality-diversity search).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

from stages.shape.arrays import Float32Array
from stages.variations.features import AXES, Axis

__all__ = ["Archive", "Cell", "cell_of"]

Cell = tuple[int, ...]

_SHARES = ("mixture", "blend", "distance")


def cell_of(features: Float32Array, axes: Sequence[Axis], resolution: int) -> Cell:
    """The cell of features float32 (9,): sizes by octaves, shares in equal steps with 0 apart, the dominant type."""
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
        self.quota = quota
        self.cells: Counter[Cell] = Counter()
        self.histograms: Counter[int] = Counter()

    def add(self, cell: Cell, histogram: int) -> None:
        """Count one variant, `histogram` being a hash of its type histogram."""
        self.cells[cell] += 1
        self.histograms[histogram] += 1

    def crowd(self, cell: Cell, histogram: int) -> int:
        """How common such variants are; the rarest have the least."""
        return self.cells[cell] * self.histograms[histogram]

    def is_full(self, cell: Cell, histogram: int) -> bool:
        """Whether the archive has enough of such variants: the histogram is known and the cell has its quota."""
        return histogram in self.histograms and self.cells[cell] >= self.quota
