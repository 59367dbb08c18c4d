"""How a VAE of part graphs learns: by the parts of each node in the order of its program, so that none has to be
assigned, for which StructureNet looks for the cheapest assignment of unordered ones."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Generator, Tensor
from torch.nn.functional import binary_cross_entropy_with_logits

from pipeline.stage import Outcome, Task
from stages.training.latent import reparameterize
from stages.training.loop import resolve_device
from stages.training.part_graph_vae.batches import GraphBatch, GraphCorpus, batches
from stages.training.part_graph_vae.corpus import prepare_corpus, read_corpus
from stages.training.part_graph_vae.model import PartGraphVae
from stages.training.part_graph_vae.settings import PartGraphVaeConfig
from stages.training.training_task import sample_digests, weighted_means


def prepare(task: Task) -> Outcome:
    """The shapes of a category, as graphs of parts."""
    return prepare_corpus(task)


def entry(settings: Mapping[str, Any]) -> PartGraphVaeConfig:
    """The entry whose JSON is `settings`."""
    return PartGraphVaeConfig.model_validate(settings)


def learner(task: Task, entry: PartGraphVaeConfig, seed: int) -> PartGraphVaeTask:
    """A model with fresh weights beside the shapes of its category."""
    described, graphs = read_corpus(task, task.shard.params["data"])
    header = {**described, "data": sample_digests(task, "safetensors")}
    module = new_model(entry, seed).to(resolve_device(entry.device))
    return PartGraphVaeTask(module, header, entry, graphs["train"], graphs["val"])


def new_model(entry: PartGraphVaeConfig, seed: int) -> PartGraphVae:
    """A model with random weights, by its seed alone."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        return PartGraphVae(entry)


@dataclass(frozen=True)
class PartGraphVaeTask:
    """The `Learner` of a VAE of part graphs."""

    module: PartGraphVae
    header: Mapping[str, Any]
    entry: PartGraphVaeConfig
    train: GraphCorpus
    val: GraphCorpus

    def batches(self, rng: np.random.Generator) -> Iterator[GraphBatch]:
        """Random batches of train, one pass after another."""
        device = next(self.module.parameters()).device
        while True:
            for levels in batches(self.train, self.entry.batch_size, rng):
                yield [level.to(device) for level in levels]

    def losses(self, batch: GraphBatch, step: int, noise: Generator) -> dict[str, Tensor]:
        """Means over shapes: nats of what is there, has parts and touches, absolute errors of the numbers of boxes, and
        the divergence from the prior."""
        points, divergence = reparameterize(*self.module.encode(batch), noise)
        nats, errors = (each / len(points) for each in reconstruction(self.module, batch, points))
        loss = nats + self.entry.number_weight * errors + self.entry.kl_weight * divergence
        return {"loss": loss, "nats": nats, "errors": errors, "divergence": divergence}

    def validate(self, noise: Generator) -> dict[str, float]:
        """The same on val; and the module learns where the shapes of train stand."""
        device = next(self.module.parameters()).device
        train, val = (batches(each, self.entry.batch_size, None) for each in (self.train, self.val))
        self.module.fit_posterior(self.module.encode([level.to(device) for level in levels]) for levels in train)
        found = ((self.losses([each.to(device) for each in levels], 0, noise), len(levels[0].boxes)) for levels in val)
        return weighted_means(found, len(self.val))


def reconstruction(module: PartGraphVae, levels: GraphBatch, points: Tensor) -> tuple[Tensor, Tensor]:
    """Sums over all shapes at these points of the latent space: nats of choices, and absolute errors of numbers."""
    nats, errors = points.new_zeros(()), points.new_zeros(())
    codes = module.root(points)
    for level in levels:
        said = module.decode(codes)
        both = torch.triu(level.there[:, :, None] * level.there[:, None], diagonal=1)
        nats = nats + _nats(said.there, level.there, None) + _nats(said.inner, level.inner, level.there)
        nats = nats + _nats(said.touching, level.touching, both)
        errors = errors + ((said.boxes - level.boxes).abs().sum(dim=-1) * level.there).sum()
        codes = said.codes.flatten(0, 1)[level.opened]
    return nats, errors


def _nats(logits: Tensor, flags: Tensor, weights: Tensor | None) -> Tensor:
    return binary_cross_entropy_with_logits(logits.float(), flags, weight=weights, reduction="sum")
