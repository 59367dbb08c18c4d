"""The strings that a string VAE learns from, by numbers, and the batches of a step."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from stages.training.pooling import pooled

__all__ = ["Batch", "Strings", "batches"]


@dataclass(frozen=True)
class Strings:
    """Strings of one kit and split.

    tokens: int16, all strings behind each other, each with its end; first: int64 (strings + 1,), where each begins;
    masks: uint8 (tokens, bytes), for each token the bits of those that may stand there; graph: int32 (strings,), the
    number of each string's graph; histograms: int32 (graphs, types), how often each type stands in a graph.
    """

    tokens: npt.NDArray[np.int16]
    first: npt.NDArray[np.int64]
    masks: npt.NDArray[np.uint8]
    graph: npt.NDArray[np.int32]
    histograms: npt.NDArray[np.int32]

    @classmethod
    def of(cls, arrays: Mapping[str, npt.NDArray[Any]]) -> Strings:
        return cls(**{name: arrays[name] for name in cls.__dataclass_fields__})

    def arrays(self) -> dict[str, npt.NDArray[Any]]:
        """The arrays by name."""
        return dict(vars(self))

    def __len__(self) -> int:
        return len(self.graph)

    @property
    def lengths(self) -> npt.NDArray[np.int64]:
        """Tokens of each string, its end among them, int64 (strings,)."""
        return np.diff(self.first)


@dataclass(frozen=True)
class Batch:
    """codes: int64 (n, longest), END behind the end of a string; lengths: int64 (n,), with the end; allowed: bool
    (n, longest, vocabulary); histograms: float (n, types)."""

    codes: Tensor
    lengths: Tensor
    allowed: Tensor
    histograms: Tensor

    def to(self, device: torch.device) -> Batch:
        """The batch on another device; lengths stay."""
        move = {name: tensor.to(device) for name, tensor in vars(self).items() if name != "lengths"}
        return Batch(**move, lengths=self.lengths)


def batches(strings: Strings, size: int, vocabulary: int, rng: np.random.Generator | None) -> Iterator[Batch]:
    """All strings once, in random order and in batches of strings of like length; with no `rng`, in their order."""
    for rows in pooled(strings.lengths, size, rng):
        yield batch_of(strings, rows, vocabulary)


def batch_of(strings: Strings, rows: npt.NDArray[np.int64], vocabulary: int) -> Batch:
    """The batch of some strings, int64 (n,)."""
    lengths = strings.lengths[rows]
    place = np.arange(lengths.max())
    there = place < lengths[:, None]
    at = np.where(there, strings.first[rows][:, None] + place, 0)
    codes = np.where(there, strings.tokens[at], 0).astype(np.int64)
    allowed = np.unpackbits(strings.masks[at], axis=-1, count=vocabulary, bitorder="little").astype(np.bool_)
    allowed[~there] = True
    return Batch(
        codes=torch.from_numpy(codes),
        lengths=torch.from_numpy(lengths),
        allowed=torch.from_numpy(allowed),
        histograms=torch.from_numpy(strings.histograms[strings.graph[rows]].astype(np.float32)),
    )
