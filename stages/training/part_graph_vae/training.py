"""Train a VAE of part graphs.

Parts are in the order of their program, so none has to be assigned; StructureNet searches for the cheapest assignment
of unordered parts.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import torch
from torch import Generator, Tensor
from torch.nn.functional import binary_cross_entropy_with_logits

from pipeline.stage import Task
from stages.training.corpus import read_description, read_splits
from stages.training.kind import Kind
from stages.training.latent import reparameterize
from stages.training.part_graph_vae.batches import GraphBatch, GraphCorpus, batches
from stages.training.part_graph_vae.corpus import prepare
from stages.training.part_graph_vae.model import PartGraphVae
from stages.training.part_graph_vae.settings import PartGraphVaeConfig
from stages.training.training_task import TrainingTask, seeded


@dataclass(frozen=True)
class PartGraphVaeTask(TrainingTask):
    """Training of a VAE of part graphs."""

    def epoch(self, samples: GraphCorpus, rng: np.random.Generator | None) -> Iterator[GraphBatch]:
        return batches(samples, self.config.batch_size, rng)

    def losses(self, batch: GraphBatch, step: int, noise: Generator) -> dict[str, Tensor]:
        """Compute means over shapes: nats of choices, absolute errors of boxes, divergence from the prior."""
        mean, log_variance = self.module.encode(batch)
        points, divergence = reparameterize(mean, log_variance, noise)
        nats, errors = (total / len(points) for total in part_graph_reconstruction(self.module, batch, points))
        loss = nats + self.config.number_weight * errors + self.config.kl_weight * divergence
        return {"loss": loss, "nats": nats, "errors": errors, "divergence": divergence}


def new_task(task: Task, config: PartGraphVaeConfig, seed: int) -> PartGraphVaeTask:
    samples = read_splits(task, GraphCorpus)
    return PartGraphVaeTask.of(task, config, new_model(config, seed), samples, read_description(task))


def new_model(config: PartGraphVaeConfig, seed: int) -> PartGraphVae:
    return seeded(seed, lambda: PartGraphVae(config))


def part_graph_reconstruction(module: PartGraphVae, levels: GraphBatch, points: Tensor) -> tuple[Tensor, Tensor]:
    """Return sums over the shapes at latent points: nats of choices, and absolute errors of boxes."""
    nats, errors = points.new_zeros(()), points.new_zeros(())
    codes = module.root(points)
    for level in levels:
        parts = module.decode(codes)
        mask = level.part_mask
        pairs = torch.triu(mask[:, :, None] * mask[:, None], diagonal=1)
        nats = nats + _nats(parts.exists, mask, None) + _nats(parts.inner, level.inner, mask)
        nats = nats + _nats(parts.touching, level.touching, pairs)
        errors = errors + ((parts.boxes - level.boxes).abs().sum(dim=-1) * mask).sum()
        codes = parts.codes.flatten(0, 1)[level.opened]
    return nats, errors


def _nats(logits: Tensor, flags: Tensor, weights: Tensor | None) -> Tensor:
    return binary_cross_entropy_with_logits(logits.float(), flags, weight=weights, reduction="sum")


KIND = Kind(PartGraphVaeConfig, prepare, new_task)
