"""Programs as words: the samples of a category, and the batches of a step."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from stages.training.bucketing import bucket_batches, padded_rows
from stages.training.corpus import ArrayCorpus
from stages.training.program_lm.partial_program import SIZE_INPUTS
from stages.training.program_vae.lines import START


@dataclass(frozen=True)
class WordSequence:
    """One program of k words.

    words: int64 (k,).
    cues: int64 (k, 4), `PartialProgram.cue` before each word.
    sizes: float32 (k, SIZE_INPUTS), `PartialProgram.size_inputs` before each word.
    """

    words: npt.NDArray[np.int64]
    cues: npt.NDArray[np.int64]
    sizes: npt.NDArray[np.float32]


@dataclass(frozen=True)
class WordCorpus(ArrayCorpus):
    """The programs of one category and split, joined.

    words: int16 (w,).
    cues: int8 (w, 4).
    sizes: float32 (w, SIZE_INPUTS).
    first: int64 (programs + 1,), where each program begins.
    """

    words: npt.NDArray[np.int16]
    cues: npt.NDArray[np.int8]
    sizes: npt.NDArray[np.float32]
    first: npt.NDArray[np.int64]

    @classmethod
    def of(cls, programs: Sequence[WordSequence]) -> WordCorpus:
        """Join at least one program."""
        return cls(
            words=np.concatenate([program.words for program in programs]).astype(np.int16),
            cues=np.concatenate([program.cues for program in programs]).astype(np.int8),
            sizes=np.concatenate([program.sizes for program in programs]),
            first=np.cumsum([0, *(len(program.words) for program in programs)]),
        )

    def __len__(self) -> int:
        return len(self.first) - 1


@dataclass(frozen=True)
class WordBatch:
    """Padded programs.

    words: int64 (n, longest).
    cues: int64 (n, longest, 4).
    sizes: float (n, longest, SIZE_INPUTS).
    places: int64 (k,), index of each word in programs x longest.
    """

    words: Tensor
    cues: Tensor
    sizes: Tensor
    places: Tensor

    def __len__(self) -> int:
        return len(self.words)

    def to(self, device: torch.device) -> WordBatch:
        return WordBatch(**{name: tensor.to(device, non_blocking=True) for name, tensor in vars(self).items()})

    @property
    def before(self) -> Tensor:
        """The word before each word, START before the first; int64 (n, longest)."""
        return torch.cat([torch.full_like(self.words[:, :1], START), self.words[:, :-1]], dim=1)


def batches(texts: WordCorpus, size: int, rng: np.random.Generator | None) -> Iterator[WordBatch]:
    """Yield all programs once, in batches as `bucket_batches`."""
    for programs in bucket_batches(np.diff(texts.first), size, rng):
        filled, rows = padded_rows(texts.first, programs)
        yield WordBatch(
            words=torch.from_numpy(texts.words[rows].astype(np.int64)),
            cues=torch.from_numpy(texts.cues[rows].astype(np.int64)),
            sizes=torch.from_numpy(texts.sizes[rows]).view(*rows.shape, SIZE_INPUTS),
            places=torch.from_numpy(np.flatnonzero(filled)),
        )
