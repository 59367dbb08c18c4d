"""Cuboid sequences: the samples of a category, and the batches of a step. A cuboid takes three steps, one an axis."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from stages.shape.arrays import FloatArray
from stages.training.box_vectors import BOX_WIDTH, ROTATION
from stages.training.bucketing import bucket_batches
from stages.training.corpus import ArrayCorpus

MAX_BOXES = 32
"""Cuboids of a shape; a mirrored pair counts once."""

NUMBERS_PER_STEP = 3
"""Position along the axis, size, rotation about it."""

FLAG_COUNT = 2
"""Whether a cuboid is mirrored, and whether it is rotated."""

END_KIND = 4
"""The kind that ends a shape; that of a cuboid is `2 * mirrored + rotated`."""

KIND_COUNT = 5

INPUT_WIDTH = NUMBERS_PER_STEP + FLAG_COUNT + 3
"""Numbers and flags of the step before, and a one-hot axis."""


@dataclass(frozen=True)
class CuboidCorpus(ArrayCorpus):
    """The shapes of one category and split, joined.

    rows: float32 (cuboids, 10), box vector and whether the cuboid is mirrored.
    first: int64 (shapes + 1,), where the cuboids of each shape begin.
    """

    rows: npt.NDArray[np.float32]
    first: npt.NDArray[np.int64]

    @classmethod
    def of(cls, shapes: Sequence[FloatArray]) -> CuboidCorpus:
        """Join the rows of at least one shape."""
        return cls(np.concatenate(shapes).astype(np.float32), np.cumsum([0, *map(len, shapes)]))

    def __len__(self) -> int:
        return len(self.first) - 1


@dataclass(frozen=True)
class CuboidBatch:
    """Padded cuboid sequences.

    inputs: float (n, steps, INPUT_WIDTH), what the network sees before each step.
    numbers: float (n, steps, NUMBERS_PER_STEP).
    flags: float (n, steps, FLAG_COUNT).
    kinds: int64 (n, cuboids), the end among them.
    step_mask: float (n, steps), 1 for steps of cuboids.
    kind_mask: float (n, cuboids), 1 for cuboids and the end.
    """

    inputs: Tensor
    numbers: Tensor
    flags: Tensor
    kinds: Tensor
    step_mask: Tensor
    kind_mask: Tensor

    def __len__(self) -> int:
        return len(self.inputs)

    def to(self, device: torch.device) -> CuboidBatch:
        return CuboidBatch(**{name: tensor.to(device, non_blocking=True) for name, tensor in vars(self).items()})


def batches(cuboids: CuboidCorpus, size: int, rng: np.random.Generator | None) -> Iterator[CuboidBatch]:
    """Yield all shapes once, in batches as `bucket_batches`."""
    for shapes in bucket_batches(np.diff(cuboids.first), size, rng):
        yield batch_of(cuboids, shapes)


def batch_of(cuboids: CuboidCorpus, shapes: npt.NDArray[np.int64]) -> CuboidBatch:
    """Build the batch of some shapes, int64 (n,)."""
    lengths = np.diff(cuboids.first)[shapes]
    column = np.arange(lengths.max() + 1)
    filled = column < lengths[:, None]
    rows = np.where(filled, cuboids.first[shapes][:, None] + column, 0)
    boxes = np.where(filled[..., None], cuboids.rows[rows], np.float32(0))
    rotated = (boxes[..., ROTATION] != 0).any(axis=-1)
    flags = np.stack([boxes[..., BOX_WIDTH] > 0, rotated], axis=-1)
    kinds = np.where(filled, flags @ np.array([2, 1]), END_KIND)
    # A box vector is ordered by quantity, then by axis; a step takes all quantities of one axis.
    by_axis = boxes[..., :BOX_WIDTH].reshape(*rows.shape, NUMBERS_PER_STEP, 3).swapaxes(2, 3)
    numbers = by_axis.reshape(len(shapes), -1, NUMBERS_PER_STEP)
    flags = flags.repeat(3, axis=1).astype(np.float32)
    steps = np.concatenate([numbers, flags], axis=-1)
    before = np.concatenate([np.zeros_like(steps[:, :1]), steps[:, :-1]], axis=1)
    axes = np.broadcast_to(np.tile(np.eye(3, dtype=np.float32), (len(column), 1)), (*numbers.shape[:2], 3))
    return CuboidBatch(
        inputs=torch.from_numpy(np.concatenate([before, axes], axis=-1)),
        numbers=torch.from_numpy(numbers),
        flags=torch.from_numpy(flags),
        kinds=torch.from_numpy(kinds),
        step_mask=torch.from_numpy(filled.repeat(3, axis=1).astype(np.float32)),
        kind_mask=torch.from_numpy((column <= lengths[:, None]).astype(np.float32)),
    )
