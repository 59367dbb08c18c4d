"""What a kind of model is to its training: parameters, batches, losses, and a look at what it has not learnt from."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any, Protocol

import numpy as np
from torch import Generator, Tensor, nn

from pipeline.paths import file_digest
from pipeline.stage import Task


class TrainingTask(Protocol):
    """A model and the samples it learns from. A kind's `training.py` makes one: `learner(task, entry) -> Learner`."""

    @property
    def module(self) -> nn.Module:
        """The parameters, on their device."""

    @property
    def header(self) -> Mapping[str, Any]:
        """What weights must say of themselves to be read again, as JSON: vocabulary, sizes, sha256 of the samples."""

    def batches(self, rng: np.random.Generator) -> Iterator[Any]:
        """Batches without end, on the device."""

    def losses(self, batch: Any, step: int, noise: Generator) -> dict[str, Tensor]:
        """Figures of a batch, scalars; `loss` is what is minimised."""

    def validate(self, noise: Generator) -> dict[str, float]:
        """Figures on the validation split; `loss` says which weights are best, and is the same measure at each step."""


def sample_digests(task: Task, suffix: str) -> dict[str, str]:
    """The sha256 of the prepared samples that a model learns from and of those that judge it, for its header.

    suffix: how their files end.
    """
    data = task.shard.params["data"]
    return {split: file_digest(task.input("training", f"{data}.{split}.{suffix}")) for split in ("train", "val")}


def weighted_means(found: Iterable[tuple[Mapping[str, Tensor], int]], count: int) -> dict[str, float]:
    """The means over `count` samples of figures that come as those of batches of so many samples each."""
    sums: dict[str, float] = {}
    for figures, samples in found:
        for name, value in figures.items():
            sums[name] = sums.get(name, 0.0) + float(value) * samples / count
    return sums
