"""Strings as a model of edge categories reads them, and the batches of a step."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from stages.shape.arrays import BoolArray, Float32Array
from stages.strings.alphabet import Alphabet
from stages.strings.categories import CategorySpace, token_edges
from stages.strings.decoder import decode
from stages.strings.tokens import number_value
from stages.training.bucketing import bucket_batches

PAD_CODE = 0
"""The code of what stands behind a string; the code of a part is its label's number plus one."""
COLUMNS = ("code", "here", "there")
"""What a string has for each token: its code, and the tokens of the parts at the two ends of its edge, or -1."""

Rows = npt.NDArray[np.int16]


def read_string(string: str, alphabet: Alphabet, cycles: int) -> Rows:
    """A string as COLUMNS, int16 (tokens, 3). Numbers from `cycles` on are read as the last below. Raises
    StringError."""
    decoded = decode(string, alphabet)
    plain = len(alphabet.tokens) + 3
    codes, parts = [], []
    for token, text in enumerate(decoded.texts):
        number = number_value(text)
        if number is not None:
            codes.append(plain + min(number, max(cycles, 1) - 1))
        elif text in "()":
            codes.append(plain - 2 + "()".index(text))
        else:
            codes.append(1 + alphabet.types[text])
            parts.append(token)
    edges = np.append(parts, -1)[token_edges(decoded)]
    return np.column_stack([codes, edges]).astype(np.int16)


@dataclass(frozen=True)
class CategoryTables:
    """What a model must know of the categories of a kit.

    masks: bool (labels + 1, labels + 1, categories), which an edge may have, by the codes of the parts at its ends, 0
    where there is none; poses: float32 (categories, 4, 4), of the child's frame in its parent's, in the length of a
    part.
    """

    masks: BoolArray
    poses: Float32Array

    @classmethod
    def of(cls, space: CategorySpace) -> CategoryTables:
        poses = space.poses.astype(np.float32)
        poses[:, :3, 3] /= np.float32(np.mean([each.diagonal for each in space.kit.types]))
        return cls(space.masks, poses)


@dataclass(frozen=True)
class LabelledStrings:
    """Strings of one kit and split, mapped from a file.

    rows: int16 (tokens, 4), COLUMNS and the category, all strings behind each other; first: int64 (strings + 1,), where
    each begins; graph: int32 (strings,), the number of each string's shape.
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
        """The rows of a string, int16 (tokens, 4)."""
        return self.rows[self.first[number] : self.first[number + 1]]


@dataclass(frozen=True)
class CategoryBatch:
    """codes, here, there: int64 (n, longest); categories: int64 (n, longest), the dummy where there is no token;
    allowed: bool (n, longest, categories); lengths: int64 (n,)."""

    codes: Tensor
    here: Tensor
    there: Tensor
    categories: Tensor
    allowed: Tensor
    lengths: Tensor

    def to(self, device: torch.device) -> CategoryBatch:
        """The batch on another device; lengths stay."""
        move = {name: tensor.to(device) for name, tensor in vars(self).items() if name != "lengths"}
        return CategoryBatch(**move, lengths=self.lengths)

    @property
    def there_is(self) -> Tensor:
        """Where there is a token, bool (n, longest)."""
        return self.codes != PAD_CODE


def batches(
    strings: LabelledStrings, size: int, masks: BoolArray, rng: np.random.Generator | None
) -> Iterator[CategoryBatch]:
    """All strings once, in random order and in batches of strings of like length; with no `rng`, in their order."""
    for chosen in bucket_batches(strings.lengths, size, rng):
        yield batch_of([strings.row(each) for each in chosen.tolist()], masks)


def batch_of(strings: Sequence[Rows], masks: BoolArray) -> CategoryBatch:
    """The batch of some strings, int16 (tokens, 3 or 4) each; masks: those of `CategoryTables`."""
    lengths = np.array([len(each) for each in strings])
    rows = np.zeros((len(strings), int(lengths.max()), 4), dtype=np.int64)
    rows[..., 1:3] = -1
    for place, each in enumerate(strings):
        rows[place, : len(each), : each.shape[1]] = each
    codes, here, there = rows[..., 0], rows[..., 1], rows[..., 2]
    ends = [np.where(each >= 0, np.take_along_axis(codes, np.maximum(each, 0), axis=1), 0) for each in (here, there)]
    return CategoryBatch(
        codes=torch.from_numpy(codes),
        here=torch.from_numpy(here),
        there=torch.from_numpy(there),
        categories=torch.from_numpy(rows[..., 3]),
        allowed=torch.from_numpy(masks[ends[0], ends[1]]),
        lengths=torch.from_numpy(lengths),
    )
