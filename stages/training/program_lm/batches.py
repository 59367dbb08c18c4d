"""The programs that a language model learns from, as words, and the batches of a step."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from stages.training.bucketing import bucket_batches
from stages.training.program_lm.partial_program import SIZE_INPUTS
from stages.training.program_vae.lines import START


@dataclass(frozen=True)
class WordSequence:
    """One program. words: its words, int64 (k,); cues: what is known of each before it is written, int64 (k, 4); seen:
    float32 (k, SEEN), as `Text` says them."""

    words: npt.NDArray[np.int64]
    cues: npt.NDArray[np.int64]
    seen: npt.NDArray[np.float32]


@dataclass(frozen=True)
class WordCorpus:
    """Programs of one category and split behind each other.

    words: int16 (w,); cues: int8 (w, 4); seen: float32 (w, SEEN); first: int64 (programs + 1,), where each begins.
    """

    words: npt.NDArray[np.int16]
    cues: npt.NDArray[np.int8]
    seen: npt.NDArray[np.float32]
    first: npt.NDArray[np.int64]

    @classmethod
    def of(cls, programs: Sequence[WordSequence]) -> WordCorpus:
        """At least one program."""
        return cls(
            words=np.concatenate([each.words for each in programs]).astype(np.int16),
            cues=np.concatenate([each.cues for each in programs]).astype(np.int8),
            seen=np.concatenate([each.seen for each in programs]),
            first=np.cumsum([0, *(len(each.words) for each in programs)]),
        )

    @classmethod
    def of_arrays(cls, arrays: Mapping[str, npt.NDArray[Any]]) -> WordCorpus:
        return cls(**{name: arrays[name] for name in cls.__dataclass_fields__})

    def arrays(self) -> dict[str, npt.NDArray[Any]]:
        """The arrays by name."""
        return dict(vars(self))

    def __len__(self) -> int:
        return len(self.first) - 1


@dataclass(frozen=True)
class WordBatch:
    """words: int64 (n, longest); cues: int64 (n, longest, 4); seen: float (n, longest, SEEN); places: int64 (k,),
    where in programs x longest the words are that a program has."""

    words: Tensor
    cues: Tensor
    seen: Tensor
    places: Tensor

    def to(self, device: torch.device) -> WordBatch:
        return WordBatch(**{name: tensor.to(device, non_blocking=True) for name, tensor in vars(self).items()})

    @property
    def before(self) -> Tensor:
        """The word before each, at first START; int64 (n, longest)."""
        return torch.cat([torch.full_like(self.words[:, :1], START), self.words[:, :-1]], dim=1)


def batches(texts: WordCorpus, size: int, rng: np.random.Generator | None) -> Iterator[WordBatch]:
    """All programs once, in random order and in batches of programs of like length; with no `rng`, in their order."""
    for rows in bucket_batches(np.diff(texts.first), size, rng):
        lengths = np.diff(texts.first)[rows]
        place = np.arange(lengths.max())
        there = place < lengths[:, None]
        at = np.where(there, texts.first[rows][:, None] + place, 0)
        yield WordBatch(
            words=torch.from_numpy(texts.words[at].astype(np.int64)),
            cues=torch.from_numpy(texts.cues[at].astype(np.int64)),
            seen=torch.from_numpy(texts.seen[at]).view(*at.shape, SIZE_INPUTS),
            places=torch.from_numpy(np.flatnonzero(there)),
        )
