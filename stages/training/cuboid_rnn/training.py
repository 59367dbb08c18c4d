"""Train a network of cuboids: the nats of each step given those before."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from torch import Generator, Tensor
from torch.nn.functional import cross_entropy

from pipeline.stage import Task
from stages.training.corpus import read_description, read_splits
from stages.training.cuboid_rnn.batches import CuboidBatch, CuboidCorpus, batches
from stages.training.cuboid_rnn.corpus import prepare
from stages.training.cuboid_rnn.model import CuboidRnn, log_density
from stages.training.cuboid_rnn.settings import CuboidRnnConfig
from stages.training.kind import Kind
from stages.training.training_task import TrainingTask, seeded


@dataclass(frozen=True)
class CuboidRnnTask(TrainingTask):
    """Training of a network of cuboids."""

    def epoch(self, samples: CuboidCorpus, rng: np.random.Generator | None) -> Iterator[CuboidBatch]:
        return batches(samples, self.config.batch_size, rng)

    def losses(self, batch: CuboidBatch, step: int, noise: Generator) -> dict[str, Tensor]:
        """Compute mean nats of a shape: of the numbers, whose densities may exceed 1, and of the kinds."""
        states, _ = self.module.read(batch.inputs)
        weights, means, deviations = self.module.numbers(states, batch.flags)
        densities = log_density(weights, means, deviations, batch.numbers, batch.flags[..., 1])
        numbers = -(densities * batch.step_mask).sum() / len(batch)
        logits = self.module.kinds(states[:, ::3]).float()
        nats = cross_entropy(logits.flatten(0, 1), batch.kinds.flatten(), reduction="none")
        kinds = (nats * batch.kind_mask.flatten()).sum() / len(batch)
        return {"loss": numbers + kinds, "numbers": numbers, "kinds": kinds}


def new_task(task: Task, config: CuboidRnnConfig, seed: int) -> CuboidRnnTask:
    samples = read_splits(task, CuboidCorpus)
    return CuboidRnnTask.of(task, config, new_model(config, seed), samples, read_description(task))


def new_model(config: CuboidRnnConfig, seed: int) -> CuboidRnn:
    return seeded(seed, lambda: CuboidRnn(config))


KIND = Kind(CuboidRnnConfig, prepare, new_task)
