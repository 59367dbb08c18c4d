"""How a network of cuboids learns: nats of each step after those before it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Generator, Tensor
from torch.nn.functional import cross_entropy

from pipeline.stage import Outcome, Task
from stages.training.cuboid_rnn.batches import CuboidBatch, CuboidCorpus, batches
from stages.training.cuboid_rnn.corpus import prepare_corpus, read_corpus
from stages.training.cuboid_rnn.model import CuboidRnn, log_density
from stages.training.cuboid_rnn.settings import CuboidRnnConfig
from stages.training.loop import resolve_device
from stages.training.training_task import sample_digests, weighted_means


def prepare(task: Task) -> Outcome:
    """The shapes of a category, as sequences of cuboids."""
    return prepare_corpus(task)


def entry(settings: Mapping[str, Any]) -> CuboidRnnConfig:
    """The entry whose JSON is `settings`."""
    return CuboidRnnConfig.model_validate(settings)


def learner(task: Task, entry: CuboidRnnConfig, seed: int) -> CuboidRnnTask:
    """A model with fresh weights beside the shapes of its category."""
    described, cuboids = read_corpus(task, task.shard.params["data"])
    header = {**described, "data": sample_digests(task, "safetensors")}
    module = new_model(entry, seed).to(resolve_device(entry.device))
    return CuboidRnnTask(module, header, entry, cuboids["train"], cuboids["val"])


def new_model(entry: CuboidRnnConfig, seed: int) -> CuboidRnn:
    """A model with random weights, by its seed alone."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        return CuboidRnn(entry)


@dataclass(frozen=True)
class CuboidRnnTask:
    """The `Learner` of a network of cuboids."""

    module: CuboidRnn
    header: Mapping[str, Any]
    entry: CuboidRnnConfig
    train: CuboidCorpus
    val: CuboidCorpus

    def batches(self, rng: np.random.Generator) -> Iterator[CuboidBatch]:
        """Random batches of train, one pass after another."""
        device = next(self.module.parameters()).device
        while True:
            for batch in batches(self.train, self.entry.batch_size, rng):
                yield batch.to(device)

    def losses(self, batch: CuboidBatch, step: int, noise: Generator) -> dict[str, Tensor]:
        """Means over shapes: nats of the numbers, which may be negative, for they are densities, and of the kinds."""
        states, _ = self.module.read(batch.shown)
        gaussians = self.module.numbers(states, batch.flags)
        numbers = -(log_density(*gaussians, batch.numbers, batch.flags[..., 1]) * batch.there).sum() / len(batch.shown)
        logits = self.module.kinds(states[:, ::3]).float()
        said = cross_entropy(logits.flatten(0, 1), batch.kinds.flatten(), reduction="none")
        kinds = (said * batch.asked.flatten()).sum() / len(batch.shown)
        return {"loss": numbers + kinds, "numbers": numbers, "kinds": kinds}

    def validate(self, noise: Generator) -> dict[str, float]:
        """The same on val."""
        device = next(self.module.parameters()).device
        shown = batches(self.val, self.entry.batch_size, None)
        found = ((self.losses(batch.to(device), 0, noise), len(batch.shown)) for batch in shown)
        return weighted_means(found, len(self.val))
