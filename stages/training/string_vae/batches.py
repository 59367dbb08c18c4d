"""The strings that a string VAE learns from, by numbers, and the batches of a step."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from stages.training.bucketing import bucket_batches


@dataclass(frozen=True)
class StringCorpus:
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
    def of(cls, arrays: Mapping[str, npt.NDArray[Any]]) -> StringCorpus:
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

    @property
    def canonical(self) -> npt.NDArray[np.int64]:
        """For each string the first one of its graph, which stage `strings` writes canonical, int64 (strings,)."""
        return np.searchsorted(self.graph, self.graph)


@dataclass(frozen=True)
class StringBatch:
    """read: int64 (n, longest read), the strings that the encoder reads, END behind their ends; codes: int64 (n,
    longest), those that the decoder is to write; read_lengths, lengths: int64 (n,), with their ends; allowed: bool (n,
    longest, vocabulary), of `codes`; open_until: int64 (n, longest), for each of `codes` at which a cycle begins the
    place where it ends, else 0; histograms: float (n, types)."""

    read: Tensor
    read_lengths: Tensor
    codes: Tensor
    lengths: Tensor
    allowed: Tensor
    open_until: Tensor
    histograms: Tensor

    def to(self, device: torch.device) -> StringBatch:
        """The batch on another device; lengths stay."""
        return StringBatch(
            **{name: tensor if name.endswith("lengths") else tensor.to(device) for name, tensor in vars(self).items()}
        )


def batches(
    strings: StringCorpus, size: int, vocabulary: int, canonical: bool, rng: np.random.Generator | None
) -> Iterator[StringBatch]:
    """All strings once, in random order and in batches of strings of like length; with no `rng`, in their order.

    canonical: whether the canonical string of the graph is to be written, or the one that was read.
    """
    written = strings.canonical if canonical else np.arange(len(strings))
    for rows in bucket_batches(strings.lengths, size, rng):
        yield _batch(strings, rows, written[rows], vocabulary)


def _batch(
    strings: StringCorpus, read: npt.NDArray[np.int64], written: npt.NDArray[np.int64], vocabulary: int
) -> StringBatch:
    """The batch of the strings that are read and of those that are to be written, int64 (n,) each."""
    there, at = _padded(strings, written)
    allowed = np.unpackbits(strings.masks[at], axis=-1, count=vocabulary, bitorder="little").astype(np.bool_)
    allowed[~there] = True
    codes = _codes(strings, there, at)
    return StringBatch(
        read=_codes(strings, *_padded(strings, read)),
        read_lengths=torch.from_numpy(strings.lengths[read]),
        codes=codes,
        lengths=torch.from_numpy(strings.lengths[written]),
        allowed=torch.from_numpy(allowed),
        open_until=torch.from_numpy(open_until(codes.numpy(), strings.histograms.shape[1] + 3)),
        histograms=torch.from_numpy(strings.histograms[strings.graph[read]].astype(np.float32)),
    )


def _padded(strings: StringCorpus, rows: npt.NDArray[np.int64]) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.int64]]:
    """Which places of some strings, padded to the longest, are theirs, bool (n, longest), and which token stands there,
    int64, 0 where none does."""
    lengths = strings.lengths[rows]
    place = np.arange(lengths.max())
    there = place < lengths[:, None]
    return there, np.where(there, strings.first[rows][:, None] + place, 0)


def _codes(strings: StringCorpus, there: npt.NDArray[np.bool_], at: npt.NDArray[np.int64]) -> Tensor:
    return torch.from_numpy(np.where(there, strings.tokens[at], 0).astype(np.int64))


def open_until(codes: npt.NDArray[np.int64], first: int) -> npt.NDArray[np.int64]:
    """For each token of strings int64 (n, longest) at which a cycle begins the place where it ends, else 0: int64 (n,
    longest). Tokens from `first` on are cycle numbers; what does not end is open to the last place."""
    until = np.zeros_like(codes)
    row, place = np.nonzero(codes >= first)
    order = np.lexsort((place, codes[row, place], row))
    row, place = row[order], place[order]
    number = codes[row, place]
    is_first = np.ones(len(row), np.bool_)
    is_first[1:] = (row[1:] != row[:-1]) | (number[1:] != number[:-1])
    seen = np.arange(len(row)) - np.maximum.accumulate(np.where(is_first, np.arange(len(row)), 0))
    begins = np.flatnonzero(seen % 2 == 0)
    until[row[begins], place[begins]] = codes.shape[1] - 1
    ended = begins[~np.append(is_first, True)[begins + 1]]
    until[row[ended], place[ended]] = place[ended + 1]
    return until
