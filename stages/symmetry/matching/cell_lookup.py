"""Cells and items of a grid at transformed positions, found without looking at the rest of the surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stages.shape.arrays import BoolArray, ByteArray, FloatArray, IntArray
from stages.shape.geometry.pose import invert, transform_points
from stages.symmetry.surface.grid import SurfaceGrid
from stages.symmetry.surface.lattice import BITS_PER_AXIS, cell_keys


@dataclass(frozen=True, eq=False)
class PackedSubset:
    """A subset of things by their indices, one bit each.

    bits: uint8, packed
    count: how many things there are
    chosen: how many of them are in the subset
    """

    bits: ByteArray
    count: int
    chosen: int

    @classmethod
    def of(cls, chosen: BoolArray) -> PackedSubset:
        """Pack the mask `chosen`, bool (n,)."""
        return cls(np.packbits(chosen), len(chosen), int(chosen.sum()))

    def __len__(self) -> int:
        return self.chosen

    @property
    def indices(self) -> IntArray:
        """Indices of the members, int32, ascending."""
        return np.flatnonzero(np.unpackbits(self.bits, count=self.count)).astype(np.int32)


def items_in(grid: SurfaceGrid, cells: np.ndarray) -> np.ndarray:
    """Return the items of ascending `cells`, int64 (m,), ascending."""
    first, count = grid.starts[cells], grid.starts[cells + 1] - grid.starts[cells]
    items: np.ndarray = np.repeat(first - np.cumsum(count) + count, count) + np.arange(count.sum())
    return items


def keys_at(grid: SurfaceGrid, pose: FloatArray, points: FloatArray) -> np.ndarray:
    """Return the keys of the cells, empty ones included, to which a pose (4, 4) takes points (n, 3)."""
    return cell_keys(np.floor((transform_points(pose, points) - grid.origin) / grid.cell_size).astype(np.int64))


def is_among(keys: np.ndarray, queries: np.ndarray) -> BoolArray:
    """Return which of `queries` (n,) are among ascending `keys`, bool (n,)."""
    if not len(keys):
        return np.zeros(len(queries), dtype=bool)
    known: BoolArray = keys[np.minimum(np.searchsorted(keys, queries), len(keys) - 1)] == queries
    return known


def items_moved_into(grid: SurfaceGrid, cells: IntArray, pose: FloatArray) -> np.ndarray:
    """Return the items that lie in ascending `cells` moved by `pose` (4, 4), int64 (m,), ascending.

    Only items in the box around the moved centres are tested: no point of a cell is farther from its centre than the
    width of a cell.
    """
    if not len(cells):
        return np.empty(0, dtype=np.int64)
    centres = transform_points(pose, grid.centres(cells))
    home = np.ascontiguousarray(((centres - grid.origin) / grid.cell_size).T)
    low, high = np.floor(home.min(axis=1)) - 1, np.floor(home.max(axis=1)) + 1
    first, last = np.searchsorted(
        grid.keys, [max(int(low[0]), 0) << 2 * BITS_PER_AXIS, (int(high[0]) + 1) << 2 * BITS_PER_AXIS]
    )
    y, z = grid.cells[first:last, 1], grid.cells[first:last, 2]
    in_box = (y >= low[1]) & (y <= high[1]) & (z >= low[2]) & (z <= high[2])
    items = items_in(grid, first + np.flatnonzero(in_box))
    inside: np.ndarray = items[is_among(grid.keys[cells], keys_at(grid, invert(pose), grid.points[items]))]
    return inside
