"""Train a string VAE: losses and validation (strings §5)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import torch
from torch import Generator, Tensor
from torch.nn.functional import relu

from pipeline.stage import Task
from stages.shape.graphs.histograms import histogram_metric
from stages.training.corpus import read_description, read_splits
from stages.training.kind import Kind
from stages.training.string_vae.batches import StringBatch, StringCorpus, batches
from stages.training.string_vae.corpus import prepare, vocabulary_of
from stages.training.string_vae.model import StringVae, shifted
from stages.training.string_vae.settings import StringVaeConfig
from stages.training.string_vae.vocabulary import Vocabulary
from stages.training.training_task import TrainingTask, seeded

ANNEAL_STEEPNESS = 12.0
"""The weight of the divergence rises from 0.25 % to 99.75 % of its value."""


@dataclass(frozen=True)
class StringVaeTask(TrainingTask):
    """Training of a string VAE.

    canonical: whether the target is the canonical string of the graph, or the string that is read.
    """

    vocabulary: Vocabulary
    canonical: bool

    def epoch(self, samples: StringCorpus, rng: np.random.Generator | None) -> Iterator[StringBatch]:
        return batches(samples, self.config.batch_size, len(self.vocabulary), self.canonical, rng)

    def losses(self, batch: StringBatch, step: int, noise: Generator) -> dict[str, Tensor]:
        """Compute nats of a string, divergence from the prior, and the triplet loss if it has a weight."""
        mean, log_variance = self.module.encode(batch.read, batch.read_lengths)
        points = mean + torch.exp(0.5 * log_variance) * _normal(mean, noise)
        before = shifted(batch.codes)
        hidden = torch.rand(before.shape, generator=noise, device=before.device) < self.config.word_dropout
        logits = self.module.decode(before, points, batch.open_until, hidden)
        nats, _ = self._reconstruction(logits, batch)
        divergence = _divergence(mean, log_variance)
        losses = {"nats": nats, "divergence": divergence}
        loss = nats + self.config.kl_weight * annealed(step, self.config.anneal_steps) * divergence
        if self.config.triplet_weight:
            losses["triplet"] = triplet_loss(mean, batch.histograms, self.config.triplet_margin, noise)
            loss = loss + self.config.triplet_weight * losses["triplet"]
        return {"loss": loss, **losses}

    def validation_losses(self, batch: StringBatch, noise: Generator) -> dict[str, Tensor]:
        """Compute the same with the final weight of the divergence.

        `accuracy`: share of the tokens that are the likeliest, given the right tokens before.
        """
        mean, log_variance = self.module.encode(batch.read, batch.read_lengths)
        points = mean + torch.exp(0.5 * log_variance) * _normal(mean, noise)
        logits = self.module.decode(shifted(batch.codes), points, batch.open_until)
        nats, accuracy = self._reconstruction(logits, batch)
        divergence = _divergence(mean, log_variance)
        loss = nats + self.config.kl_weight * divergence
        return {"loss": loss, "nats": nats, "divergence": divergence, "accuracy": accuracy}

    def _reconstruction(self, logits: Tensor, batch: StringBatch) -> tuple[Tensor, Tensor]:
        """Return the mean nats of a string, and the share of the tokens that are the likeliest."""
        if self.config.decoder != "plain":
            logits = logits.masked_fill(~batch.allowed, -torch.inf)
        is_token = torch.arange(batch.codes.shape[1]) < batch.lengths[:, None]
        is_token = is_token.to(logits.device)
        nats = -torch.log_softmax(logits.float(), dim=-1).gather(-1, batch.codes[..., None])[..., 0]
        right = (logits.argmax(dim=-1) == batch.codes) & is_token
        return torch.where(is_token, nats, 0.0).sum() / len(batch), right.sum() / is_token.sum()


def new_task(task: Task, config: StringVaeConfig, seed: int) -> StringVaeTask:
    description = read_description(task)
    vocabulary = vocabulary_of(description)
    canonical = config.target == "canonical" and description["edges"] != "tree"  # a graph has many spanning trees
    header = {
        **{key: description[key] for key in ("names", "edges", "cycles", "max_tokens", "patterns", "counts")},
        "canonical": canonical,
        "tokens": list(vocabulary.texts),
    }
    module = new_model(config, vocabulary, description["max_tokens"], seed)
    samples = read_splits(task, StringCorpus)
    return StringVaeTask.of(task, config, module, samples, header, vocabulary=vocabulary, canonical=canonical)


def new_model(config: StringVaeConfig, vocabulary: Vocabulary, max_tokens: int, seed: int) -> StringVae:
    """Build a model of strings of at most `max_tokens` tokens with random weights."""
    return seeded(seed, lambda: StringVae(config, len(vocabulary), vocabulary.cycles, max_tokens + 1))


def annealed(step: int, steps: int) -> float:
    """Return the share of the divergence's weight at a step, a sigmoid from 0 to 1."""
    if not steps:
        return 1.0
    return float(1.0 / (1.0 + np.exp(-ANNEAL_STEEPNESS * (step / steps - 0.5))))


def triplet_loss(points: Tensor, histograms: Tensor, margin: float, noise: Generator) -> Tensor:
    """Return the mean triplet loss (strings §5.3) of points, float (n, latent).

    Each point is compared with two random others. The one with the more similar part types should be nearer by
    `margin`, in squared distance; equally similar ones do not count.
    """
    first, second = (
        torch.randperm(len(points), generator=noise, device=noise.device).to(points.device) for _ in range(2)
    )
    differences = [histogram_metric(histograms, histograms[other]) for other in (first, second)]
    gaps = [((points - points[other]) ** 2).sum(dim=-1) for other in (first, second)]
    nearer, farther = (
        torch.where(differences[0] < differences[1], gaps[0], gaps[1]),
        torch.where(differences[0] < differences[1], gaps[1], gaps[0]),
    )
    loss: Tensor = (relu(nearer - farther + margin) * (differences[0] != differences[1])).mean()
    return loss


def _divergence(mean: Tensor, log_variance: Tensor) -> Tensor:
    """Return the mean divergence of normal distributions from the standard one, in nats."""
    return 0.5 * (mean**2 + log_variance.exp() - 1.0 - log_variance).sum(dim=-1).mean()


def _normal(like: Tensor, noise: Generator) -> Tensor:
    return torch.randn(like.shape, generator=noise, device=like.device)


KIND = Kind(StringVaeConfig, prepare, new_task)
