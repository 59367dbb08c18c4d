"""What a kind of model is to its training: parameters, batches, losses, and a look at what it has not learnt from."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Protocol

import numpy as np
from torch import Generator, Tensor, nn

__all__ = ["Learner"]


class Learner(Protocol):
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
