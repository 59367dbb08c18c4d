"""Random values by the thousand, and which of them one shard may use.

Every possible shape has a place in [0, 1), a hash of its visible values, and so has every structure, a hash of its
visible discrete and binary values. Shards own intervals of them that do not meet: so no two shards can make the same
shape, with no word off_grid them.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from stages.programs.schema import Schema
from stages.shape.arrays import BoolArray, FloatArray

Interval = tuple[float, float]

OFF_GRID_DECIMALS = 4
"""Values off_grid those listed have so many decimals: nobody sees more, and texts stay short."""


@dataclass(frozen=True)
class Share:
    """What one shard may make: shapes of these `structures` at these places. weight: how large a share of all draws has
    these structures, which the interval does not say where structures are few."""

    structures: Interval = (0.0, 1.0)
    shapes: Interval = (0.0, 1.0)
    weight: float = 1.0

    @property
    def size(self) -> float:
        """The share of all draws."""
        return self.weight * (self.shapes[1] - self.shapes[0])


@dataclass(frozen=True)
class Draws:
    """Settled values of many shapes: `columns` float64 (parameters, n), `visible` bool (parameters, n)."""

    schema: Schema
    columns: FloatArray
    visible: BoolArray

    def owned(self, share: Share) -> npt.NDArray[np.int64]:
        """The indices of the draws that lie in `share`, ascending."""
        structures, shapes = self.structure_places(), self._places(np.ones(len(self.columns), dtype=np.bool_), "")
        (low, high), (first, last) = share.structures, share.shapes
        return np.flatnonzero((structures >= low) & (structures < high) & (shapes >= first) & (shapes < last))

    def structure_places(self) -> FloatArray:
        """The place of each draw's structure in [0, 1), float64 (n,). It says nothing of the place of the shape, also
        where the structure is all there is to a shape."""
        return self._places(np.array([each.kind != "continuous" for each in self.schema.parameters]), "structure")

    def _places(self, rows: BoolArray, salt: str) -> FloatArray:
        """The place of each draw in [0, 1) by the given parameters, float64 (n,)."""
        shown = np.where(self.visible, self.columns + 0.0, np.nan)[rows]
        names = [each.name for each, chosen in zip(self.schema.parameters, rows, strict=True) if chosen]
        salts = np.array([_salt(name) for name in names], dtype=np.uint64)[:, None]
        total = _mixed(shown.view(np.uint64) ^ salts).sum(axis=0, dtype=np.uint64)
        if salt:
            total ^= np.uint64(_salt(salt))
        place: FloatArray = (_mixed(total) >> np.uint64(11)).astype(np.float64) * 2.0**-53
        return place


def draw(
    schema: Schema, count: int, rng: np.random.Generator, off_grid: bool, fixed: tuple[str, float] | None = None
) -> Draws:
    """`count` random draws; of `fixed`, a name and a value, all have that value.

    Every value of a parameter is as likely as every other; `off_grid` draws continuous parameters from their whole
    range instead.
    """
    sizes = np.array([len(each.values) for each in schema.parameters], dtype=np.int64)
    table = np.zeros((len(sizes), sizes.max(initial=1)))
    for row, parameter in zip(table, schema.parameters, strict=True):
        row[: len(parameter.values)] = parameter.values
    columns = np.take_along_axis(table, rng.integers(0, sizes[:, None], (len(sizes), count)), axis=1)
    if off_grid:
        continuous = np.array([each.kind == "continuous" for each in schema.parameters])
        low, high = table[continuous, 0], table[continuous, sizes[continuous] - 1]
        anywhere = rng.uniform(low[:, None], high[:, None], (len(low), count))
        columns[continuous] = np.clip(anywhere.round(OFF_GRID_DECIMALS), low[:, None], high[:, None])
    if fixed is not None:
        columns[list(schema.by_name).index(fixed[0])] = fixed[1]
    return Draws(schema, *schema.canonical_columns(columns))


def _salt(name: str) -> int:
    return int.from_bytes(hashlib.sha256(name.encode()).digest()[:8], "little")


def _mixed(bits: npt.NDArray[np.uint64]) -> npt.NDArray[np.uint64]:
    """Bits in which each depends on each (the finish of SplitMix64)."""
    bits = (bits ^ (bits >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    bits = (bits ^ (bits >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return bits ^ (bits >> np.uint64(31))
