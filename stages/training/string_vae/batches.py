"""Strings as token numbers: the samples of a kit, and the batches of a step."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from stages.training.bucketing import bucket_batches, padded_rows
from stages.training.corpus import ArrayCorpus


@dataclass(frozen=True)
class StringCorpus(ArrayCorpus):
    """The strings of one kit and split, joined.

    tokens: int16 (tokens,), each string with its end.
    first: int64 (strings + 1,), where each string begins.
    masks: uint8 (tokens, bytes), bits of the tokens allowed in place of each.
    graph: int32 (strings,), number of the graph of each string.
    histograms: int32 (graphs, types), parts of each type.
    """

    tokens: npt.NDArray[np.int16]
    first: npt.NDArray[np.int64]
    masks: npt.NDArray[np.uint8]
    graph: npt.NDArray[np.int32]
    histograms: npt.NDArray[np.int32]

    def __len__(self) -> int:
        return len(self.graph)

    @property
    def lengths(self) -> npt.NDArray[np.int64]:
        """Tokens of each string with its end, int64 (strings,)."""
        return np.diff(self.first)

    @property
    def canonical(self) -> npt.NDArray[np.int64]:
        """For each string the first one of its graph, the canonical one, int64 (strings,)."""
        return np.searchsorted(self.graph, self.graph)


@dataclass(frozen=True)
class StringBatch:
    """Padded strings.

    read: int64 (n, longest read), input of the encoder.
    read_lengths: int64 (n,), with the end.
    codes: int64 (n, longest), target of the decoder.
    lengths: int64 (n,), with the end.
    allowed: bool (n, longest, vocabulary), of `codes`.
    open_until: int64 (n, longest), see `open_until`.
    histograms: float (n, types).
    """

    read: Tensor
    read_lengths: Tensor
    codes: Tensor
    lengths: Tensor
    allowed: Tensor
    open_until: Tensor
    histograms: Tensor

    def __len__(self) -> int:
        return len(self.codes)

    def to(self, device: torch.device) -> StringBatch:
        """Move the batch to a device; lengths stay on the CPU."""
        return StringBatch(
            **{name: tensor if name.endswith("lengths") else tensor.to(device) for name, tensor in vars(self).items()}
        )


def batches(
    strings: StringCorpus, size: int, vocabulary: int, canonical: bool, rng: np.random.Generator | None
) -> Iterator[StringBatch]:
    """Yield all strings once, in batches as `bucket_batches`.

    canonical: whether the target is the canonical string of the graph, or the string that is read.
    """
    targets = strings.canonical if canonical else np.arange(len(strings))
    for numbers in bucket_batches(strings.lengths, size, rng):
        yield _batch(strings, numbers, targets[numbers], vocabulary)


def _batch(
    strings: StringCorpus, read: npt.NDArray[np.int64], targets: npt.NDArray[np.int64], vocabulary: int
) -> StringBatch:
    """Build the batch of the strings to read and of the target strings, int64 (n,) each."""
    filled, rows = padded_rows(strings.first, targets)
    allowed = np.unpackbits(strings.masks[rows], axis=-1, count=vocabulary, bitorder="little").astype(np.bool_)
    allowed[~filled] = True
    codes = _codes(strings, filled, rows)
    return StringBatch(
        read=_codes(strings, *padded_rows(strings.first, read)),
        read_lengths=torch.from_numpy(strings.lengths[read]),
        codes=codes,
        lengths=torch.from_numpy(strings.lengths[targets]),
        allowed=torch.from_numpy(allowed),
        open_until=torch.from_numpy(open_until(codes.numpy(), strings.histograms.shape[1] + 3)),
        histograms=torch.from_numpy(strings.histograms[strings.graph[read]].astype(np.float32)),
    )


def _codes(strings: StringCorpus, filled: npt.NDArray[np.bool_], rows: npt.NDArray[np.int64]) -> Tensor:
    return torch.from_numpy(np.where(filled, strings.tokens[rows], 0).astype(np.int64))


def open_until(codes: npt.NDArray[np.int64], first: int) -> npt.NDArray[np.int64]:
    """Return for each token that opens a cycle the index of the token that closes it, else 0: int64 (n, longest).

    codes: int64 (n, longest); those from `first` on are cycle numbers. An unclosed cycle stays open to the last index.
    """
    until = np.zeros_like(codes)
    row, index = np.nonzero(codes >= first)
    order = np.lexsort((index, codes[row, index], row))
    row, index = row[order], index[order]
    number = codes[row, index]
    is_first = np.ones(len(row), np.bool_)
    is_first[1:] = (row[1:] != row[:-1]) | (number[1:] != number[:-1])
    occurrence = np.arange(len(row)) - np.maximum.accumulate(np.where(is_first, np.arange(len(row)), 0))
    begins = np.flatnonzero(occurrence % 2 == 0)
    until[row[begins], index[begins]] = codes.shape[1] - 1
    ended = begins[~np.append(is_first, True)[begins + 1]]
    until[row[ended], index[ended]] = index[ended + 1]
    return until
