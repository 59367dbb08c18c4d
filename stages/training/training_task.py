"""What trains a model of any kind: its samples, batches, losses and validation."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Self, TypeVar

import numpy as np
import torch
from torch import Generator, Tensor, nn

from pipeline.paths import file_digest
from pipeline.stage import Task
from stages.training.latent import LatentGaussian
from stages.training.model_config import ModelConfig

Module = TypeVar("Module", bound=nn.Module)


@dataclass(frozen=True)
class TrainingTask(ABC):
    """A model with the samples that it learns from.

    module: the parameters, on their device.
    header: what weights must state to be read again, as JSON: vocabulary, sizes, sha256 of the samples.
    config: the model's entry in `training.models`.
    train, val: the samples of both splits.
    """

    module: Any
    header: Mapping[str, Any]
    config: Any
    train: Any
    val: Any

    @classmethod
    def of(
        cls,
        task: Task,
        config: ModelConfig,
        module: nn.Module,
        samples: Mapping[str, Any],
        header: Mapping[str, Any],
        suffix: str = "safetensors",
        **fields: Any,
    ) -> Self:
        """Build the task of a round.

        samples: of `train` and `val`.
        header: without the sha256 of the prepared samples.
        suffix: the end of the names of their files.
        """
        data = task.shard.params["data"]
        paths = {split: task.input("training", f"{data}.{split}.{suffix}") for split in ("train", "val")}
        header = {**header, "data": {split: file_digest(path) for split, path in paths.items()}}
        module = module.to(resolve_device(config.device))
        return cls(module, header, config, samples["train"], samples["val"], **fields)

    @property
    def device(self) -> torch.device:
        """The device of the parameters."""
        device: torch.device = next(self.module.parameters()).device
        return device

    def epoch(self, samples: Any, rng: np.random.Generator | None) -> Iterator[Any]:
        """Yield all samples once, in batches: in random order, or in their own order without `rng`.

        A task without epochs overrides `batches` and `validate`.
        """
        raise NotImplementedError

    @abstractmethod
    def losses(self, batch: Any, step: int, noise: Generator) -> dict[str, Tensor]:
        """Compute the figures of a batch, scalars; training minimises `loss`."""

    def validation_losses(self, batch: Any, noise: Generator) -> Mapping[str, Tensor]:
        """Compute the figures of a validation batch, by a measure that does not change from step to step."""
        return self.losses(batch, 0, noise)

    def batches(self, rng: np.random.Generator) -> Iterator[Any]:
        """Yield random batches of train without end, on the device."""
        while True:
            yield from self._on_device(self.epoch(self.train, rng))

    def validate(self, noise: Generator) -> dict[str, float]:
        """Compute the mean figures of val; `loss` decides which weights are best.

        A latent Gaussian is first fitted to the encoded samples of train.
        """
        if isinstance(self.module, LatentGaussian):
            self.module.fit_posterior(
                self.module.encode(batch) for batch in self._on_device(self.epoch(self.train, None))
            )
        sums: dict[str, float] = {}
        for batch in self._on_device(self.epoch(self.val, None)):
            for name, value in self.validation_losses(batch, noise).items():
                sums[name] = sums.get(name, 0.0) + float(value) * _batch_samples(batch) / len(self.val)
        return sums

    def _on_device(self, batches: Iterator[Any]) -> Iterator[Any]:
        device = self.device
        for batch in batches:
            yield [level.to(device) for level in batch] if isinstance(batch, list) else batch.to(device)


def _batch_samples(batch: Any) -> int:
    """Return the number of samples of a batch; a batch of trees is a list of levels, the roots first."""
    return len(batch[0]) if isinstance(batch, list) else len(batch)


def seeded(seed: int, build: Callable[[], Module]) -> Module:
    """Build a module whose random weights depend on the seed alone."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        return build()


def resolve_device(setting: str) -> torch.device:
    """Return the device of a config's `device`."""
    return torch.device("cuda" if setting == "cuda" or (setting == "auto" and torch.cuda.is_available()) else "cpu")
