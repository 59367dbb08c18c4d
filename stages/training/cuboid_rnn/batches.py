"""The shapes that a network of cuboids learns from, and the batches of a step: three steps a cuboid, one an axis."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from stages.shape.arrays import FloatArray
from stages.training.box_vectors import BOX_WIDTH, TURN
from stages.training.bucketing import bucket_batches

MAX_BOXES = 32
"""Cuboids of a shape, mirror images counted once."""

NUMBERS_PER_STEP = 3
"""Of a step: where the cuboid stands along its axis, its size, and how far it is turned about it."""

FLAG_COUNT = 2
"""Of a cuboid: whether it is there mirrored, too; whether it is turned."""

END_KIND = 4
"""The kind of what ends a shape; that of a cuboid is twice its first flag and its second."""

KIND_COUNT = 5

INPUT_WIDTH = NUMBERS_PER_STEP + FLAG_COUNT + 3
"""What the network sees before a step: the numbers and the flags of the one before it, and which axis comes."""


@dataclass(frozen=True)
class CuboidCorpus:
    """Shapes of one category and split behind each other. rows: float32 (cuboids, 10), numbers and whether mirrored;
    first: int64 (shapes + 1,), where the cuboids of each begin."""

    rows: npt.NDArray[np.float32]
    first: npt.NDArray[np.int64]

    @classmethod
    def of(cls, shapes: Sequence[FloatArray]) -> CuboidCorpus:
        """At least one shape."""
        return cls(np.concatenate(shapes).astype(np.float32), np.cumsum([0, *map(len, shapes)]))

    @classmethod
    def of_arrays(cls, arrays: Mapping[str, npt.NDArray[Any]]) -> CuboidCorpus:
        return cls(arrays["rows"], arrays["first"])

    def arrays(self) -> dict[str, npt.NDArray[Any]]:
        """The arrays by name."""
        return dict(vars(self))

    def __len__(self) -> int:
        return len(self.first) - 1


@dataclass(frozen=True)
class CuboidBatch:
    """shown: float (n, steps, SHOWN); numbers, flags: float (n, steps, NUMBERS) and (n, steps, FLAGS), of each step;
    kinds: int64 (n, cuboids), the end among the cuboids; there: float (n, steps), 1 for those of cuboids; asked: float
    (n, cuboids), 1 for cuboids and the end."""

    shown: Tensor
    numbers: Tensor
    flags: Tensor
    kinds: Tensor
    there: Tensor
    asked: Tensor

    def to(self, device: torch.device) -> CuboidBatch:
        return CuboidBatch(**{name: tensor.to(device, non_blocking=True) for name, tensor in vars(self).items()})


def batches(cuboids: CuboidCorpus, size: int, rng: np.random.Generator | None) -> Iterator[CuboidBatch]:
    """All shapes once, in random order and in batches of like length; with no `rng`, in their order."""
    for rows in bucket_batches(np.diff(cuboids.first), size, rng):
        yield batch_of(cuboids, rows)


def batch_of(cuboids: CuboidCorpus, rows: npt.NDArray[np.int64]) -> CuboidBatch:
    """Some shapes, int64 (n,)."""
    lengths = np.diff(cuboids.first)[rows]
    place = np.arange(lengths.max() + 1)
    there = place < lengths[:, None]
    at = np.where(there, cuboids.first[rows][:, None] + place, 0)
    found = np.where(there[..., None], cuboids.rows[at], np.float32(0))
    turned = (found[..., TURN] != 0).any(axis=-1)
    flags = np.stack([found[..., BOX_WIDTH] > 0, turned], axis=-1)
    kinds = np.where(there, flags @ np.array([2, 1]), END_KIND)
    # The numbers of a cuboid by what they say and by axis; a step has one axis.
    steps = (
        found[..., :BOX_WIDTH]
        .reshape(*at.shape, NUMBERS_PER_STEP, 3)
        .swapaxes(2, 3)
        .reshape(len(rows), -1, NUMBERS_PER_STEP)
    )
    flags = flags.repeat(3, axis=1).astype(np.float32)
    said = np.concatenate([steps, flags], axis=-1)
    before = np.concatenate([np.zeros_like(said[:, :1]), said[:, :-1]], axis=1)
    axes = np.broadcast_to(np.tile(np.eye(3, dtype=np.float32), (len(place), 1)), (*steps.shape[:2], 3))
    return CuboidBatch(
        shown=torch.from_numpy(np.concatenate([before, axes], axis=-1)),
        numbers=torch.from_numpy(steps),
        flags=torch.from_numpy(flags),
        kinds=torch.from_numpy(kinds),
        there=torch.from_numpy(there.repeat(3, axis=1).astype(np.float32)),
        asked=torch.from_numpy((place <= lengths[:, None]).astype(np.float32)),
    )
