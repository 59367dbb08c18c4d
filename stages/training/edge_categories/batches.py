"""Strings with edge categories: the samples of a kit, and the batches of a step."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from stages.shape.arrays import BoolArray, Float32Array
from stages.strings.categories import CategorySpace, token_edges
from stages.strings.decoder import decode
from stages.strings.tokens import Alphabet, number_value
from stages.training.bucketing import bucket_batches

PAD_CODE = 0
"""The code behind the end of a string; the code of a part is its label's number plus one."""
COLUMNS = ("code", "here", "there")
"""A token's code, and the tokens of the parts at both ends of its edge, or -1."""

Rows = npt.NDArray[np.int16]


def read_string(string: str, alphabet: Alphabet, cycles: int) -> Rows:
    """Read a string as COLUMNS, int16 (tokens, 3). Cycle numbers from `cycles` on share the last code.

    Raises StringError.
    """
    decoded = decode(string, alphabet)
    first_number = len(alphabet.tokens) + 3
    codes, parts = [], []
    for token, text in enumerate(decoded.texts):
        number = number_value(text)
        if number is not None:
            codes.append(first_number + min(number, max(cycles, 1) - 1))
        elif text in "()":
            codes.append(first_number - 2 + "()".index(text))
        else:
            codes.append(1 + alphabet.types[text])
            parts.append(token)
    edges = np.append(parts, -1)[token_edges(decoded)]
    return np.column_stack([codes, edges]).astype(np.int16)


@dataclass(frozen=True)
class CategoryTables:
    """The categories of a kit.

    masks: bool (labels + 1, labels + 1, categories), the categories that an edge may have, by the codes of the parts at
        its ends, 0 for no part.
    poses: float32 (categories, 4, 4), of the child's frame in its parent's; unit: mean diagonal of a part type.
    """

    masks: BoolArray
    poses: Float32Array

    @classmethod
    def of(cls, space: CategorySpace) -> CategoryTables:
        """Build the tables of a kit's category space."""
        poses = space.poses.astype(np.float32)
        poses[:, :3, 3] /= np.float32(np.mean([part_type.diagonal for part_type in space.kit.types]))
        return cls(space.masks, poses)


@dataclass(frozen=True)
class LabelledStrings:
    """The strings of one kit and split, mapped from a file.

    rows: int16 (tokens, 4), COLUMNS and the category, all strings joined.
    first: int64 (strings + 1,), where each string begins.
    graph: int32 (strings,), number of the shape of each string.
    """

    rows: Rows
    first: npt.NDArray[np.int64]
    graph: npt.NDArray[np.int32]

    def __len__(self) -> int:
        return len(self.graph)

    @property
    def lengths(self) -> npt.NDArray[np.int64]:
        """Tokens of each string, int64 (strings,)."""
        return np.diff(self.first)

    def row(self, number: int) -> Rows:
        """Return the rows of a string, int16 (tokens, 4)."""
        return self.rows[self.first[number] : self.first[number + 1]]


@dataclass(frozen=True)
class CategoryBatch:
    """Padded strings.

    codes, here, there: int64 (n, longest), as COLUMNS.
    categories: int64 (n, longest), the dummy at padding.
    allowed: bool (n, longest, categories).
    lengths: int64 (n,).
    """

    codes: Tensor
    here: Tensor
    there: Tensor
    categories: Tensor
    allowed: Tensor
    lengths: Tensor

    def to(self, device: torch.device) -> CategoryBatch:
        """Move the batch to a device; lengths stay on the CPU."""
        moved = {name: tensor.to(device) for name, tensor in vars(self).items() if name != "lengths"}
        return CategoryBatch(**moved, lengths=self.lengths)

    @property
    def is_token(self) -> Tensor:
        """Where a string has a token, bool (n, longest)."""
        return self.codes != PAD_CODE


def batches(
    strings: LabelledStrings, size: int, masks: BoolArray, rng: np.random.Generator | None
) -> Iterator[CategoryBatch]:
    """Yield all strings once, in batches as `bucket_batches`. masks: those of `CategoryTables`."""
    for numbers in bucket_batches(strings.lengths, size, rng):
        yield batch_of([strings.row(number) for number in numbers.tolist()], masks)


def batch_of(strings: Sequence[Rows], masks: BoolArray) -> CategoryBatch:
    """Build the batch of some strings, int16 (tokens, 3 or 4) each. masks: those of `CategoryTables`."""
    lengths = np.array([len(string) for string in strings])
    rows = np.zeros((len(strings), int(lengths.max()), 4), dtype=np.int64)
    rows[..., 1:3] = -1
    for index, string in enumerate(strings):
        rows[index, : len(string), : string.shape[1]] = string
    codes, here, there = rows[..., 0], rows[..., 1], rows[..., 2]
    ends = [np.where(end >= 0, np.take_along_axis(codes, np.maximum(end, 0), axis=1), 0) for end in (here, there)]
    return CategoryBatch(
        codes=torch.from_numpy(codes),
        here=torch.from_numpy(here),
        there=torch.from_numpy(there),
        categories=torch.from_numpy(rows[..., 3]),
        allowed=torch.from_numpy(masks[ends[0], ends[1]]),
        lengths=torch.from_numpy(lengths),
    )
