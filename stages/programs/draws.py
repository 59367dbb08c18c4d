"""Random values in large numbers, and which of them one shard may use.

Every shape has a hash in [0, 1) of its visible values, and every structure one of its visible discrete and binary
values. Shards own disjoint intervals of these hashes, so no two shards make the same shape, without communication.
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
"""Of values between the listed ones: more are invisible and make texts longer."""


@dataclass(frozen=True)
class Share:
    """What one shard may make.

    structures, shapes: intervals of the hashes
    weight: share of all draws that has these structures; with few structures, the size of the interval does not tell
    """

    structures: Interval = (0.0, 1.0)
    shapes: Interval = (0.0, 1.0)
    weight: float = 1.0

    @property
    def size(self) -> float:
        """The share of all draws."""
        return self.weight * (self.shapes[1] - self.shapes[0])


@dataclass(frozen=True)
class Draws:
    """Canonical values of many shapes.

    columns: float64 (parameters, n)
    visible: bool (parameters, n)
    """

    schema: Schema
    columns: FloatArray
    visible: BoolArray

    def owned(self, share: Share) -> npt.NDArray[np.int64]:
        """The indices of the draws in `share`, ascending."""
        structures, shapes = self.structure_hashes(), self._hashes(np.ones(len(self.columns), dtype=np.bool_), "")
        (low, high), (first, last) = share.structures, share.shapes
        return np.flatnonzero((structures >= low) & (structures < high) & (shapes >= first) & (shapes < last))

    def structure_hashes(self) -> FloatArray:
        """The hash of each draw's structure in [0, 1), float64 (n,), independent of the hash of its shape."""
        return self._hashes(
            np.array([parameter.kind != "continuous" for parameter in self.schema.parameters]), "structure"
        )

    def _hashes(self, rows: BoolArray, salt: str) -> FloatArray:
        """The hash of each draw in [0, 1) by the parameters of the rows, float64 (n,)."""
        shown = np.where(self.visible, self.columns + 0.0, np.nan)[rows]
        names = [parameter.name for parameter, hashed in zip(self.schema.parameters, rows, strict=True) if hashed]
        salts = np.array([_salt(name) for name in names], dtype=np.uint64)[:, None]
        total = _mixed(shown.view(np.uint64) ^ salts).sum(axis=0, dtype=np.uint64)
        if salt:
            total ^= np.uint64(_salt(salt))
        hashes: FloatArray = (_mixed(total) >> np.uint64(11)).astype(np.float64) * 2.0**-53
        return hashes


def draw(
    schema: Schema, count: int, rng: np.random.Generator, off_grid: bool, fixed: tuple[str, float] | None = None
) -> Draws:
    """Draw `count` random shapes; `fixed` is the name and the value of a parameter that all have.

    All listed values of a parameter are equally likely; `off_grid` draws continuous ones from their whole range.
    """
    sizes = np.array([len(parameter.values) for parameter in schema.parameters], dtype=np.int64)
    table = np.zeros((len(sizes), sizes.max(initial=1)))
    for row, parameter in zip(table, schema.parameters, strict=True):
        row[: len(parameter.values)] = parameter.values
    columns = np.take_along_axis(table, rng.integers(0, sizes[:, None], (len(sizes), count)), axis=1)
    if off_grid:
        continuous = np.array([parameter.kind == "continuous" for parameter in schema.parameters])
        low, high = table[continuous, 0], table[continuous, sizes[continuous] - 1]
        uniform = rng.uniform(low[:, None], high[:, None], (len(low), count))
        columns[continuous] = np.clip(uniform.round(OFF_GRID_DECIMALS), low[:, None], high[:, None])
    if fixed is not None:
        columns[list(schema.by_name).index(fixed[0])] = fixed[1]
    return Draws(schema, *schema.canonical_columns(columns))


def _salt(name: str) -> int:
    return int.from_bytes(hashlib.sha256(name.encode()).digest()[:8], "little")


def _mixed(bits: npt.NDArray[np.uint64]) -> npt.NDArray[np.uint64]:
    """Mix all bits with all others (the finalizer of SplitMix64)."""
    bits = (bits ^ (bits >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    bits = (bits ^ (bits >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return bits ^ (bits >> np.uint64(31))
