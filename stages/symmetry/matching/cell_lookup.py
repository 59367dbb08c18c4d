"""Which cells and items of a grid lie where a motion takes others, without a look at the rest of the surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stages.shape.arrays import BoolArray, ByteArray, FloatArray, IntArray
from stages.shape.geometry.pose import invert, transform_points
from stages.symmetry.surface.grid import SurfaceGrid
from stages.symmetry.surface.lattice import cell_keys


@dataclass(frozen=True, eq=False)
class ChosenSet:
    """Which of many things are chosen, a bit each, uint8 (bytes,); how many there are, and how many of them are."""

    bits: ByteArray
    count: int
    chosen: int

    @classmethod
    def of(cls, chosen: BoolArray) -> ChosenSet:
        """Those that are `chosen`, bool (n,)."""
        return cls(np.packbits(chosen), len(chosen), int(chosen.sum()))

    def __len__(self) -> int:
        return self.chosen

    @property
    def indices(self) -> IntArray:
        """Where they are, int32 ascending."""
        return np.flatnonzero(np.unpackbits(self.bits, count=self.count)).astype(np.int32)


def items_in(grid: SurfaceGrid, cells: np.ndarray) -> np.ndarray:
    """The items of ascending `cells`, int64 (m,) ascending."""
    first, count = grid.starts[cells], grid.starts[cells + 1] - grid.starts[cells]
    found: np.ndarray = np.repeat(first - np.cumsum(count) + count, count) + np.arange(count.sum())
    return found


def keys_at(grid: SurfaceGrid, pose: FloatArray, points: FloatArray) -> np.ndarray:
    """Keys of the cells, empty ones too, to which a pose (4, 4) takes points (n, 3)."""
    return cell_keys(np.floor((transform_points(pose, points) - grid.origin) / grid.cell_size).astype(np.int64))


def is_among(keys: np.ndarray, asked: np.ndarray) -> BoolArray:
    """Which of the keys `asked`, (n,), are among ascending `keys`, bool (n,)."""
    if not len(keys):
        return np.zeros(len(asked), dtype=bool)
    found: BoolArray = keys[np.minimum(np.searchsorted(keys, asked), len(keys) - 1)] == asked
    return found


def items_moved_into(grid: SurfaceGrid, cells: IntArray, pose: FloatArray) -> np.ndarray:
    """The items that lie in ascending `cells` moved by `pose` (4, 4), int64 (m,) ascending.

    No point of a cell is farther from its middle than a cell is wide: those of the box around the moved middles are
    asked.
    """
    middles = transform_points(pose, grid.origin + (grid.cells[cells] + 0.5) * grid.cell_size)
    home = (middles - grid.origin) / grid.cell_size
    low, high = np.floor(home.min(axis=0)) - 1, np.floor(home.max(axis=0)) + 1
    items = items_in(grid, np.flatnonzero(((grid.cells >= low) & (grid.cells <= high)).all(axis=1)))
    found: np.ndarray = items[is_among(grid.keys[cells], keys_at(grid, invert(pose), grid.points[items]))]
    return found
