"""How a string VAE learns: its samples, its losses, its validation (strings §5)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Generator, Tensor
from torch.nn.functional import relu

from pipeline.stage import Outcome, Task
from stages.shape.graphs.histograms import histogram_metric
from stages.training.loop import resolve_device
from stages.training.string_vae.batches import StringBatch, StringCorpus, batches
from stages.training.string_vae.corpus import prepare_corpus, read_corpus
from stages.training.string_vae.model import StringVae, shifted
from stages.training.string_vae.settings import StringVaeConfig
from stages.training.string_vae.vocabulary import Vocabulary
from stages.training.training_task import sample_digests, weighted_means

ANNEAL_STEEPNESS = 12.0
"""The weight of the divergence goes from 0.25 % to 99.75 % of its value along its S."""


def prepare(task: Task) -> Outcome:
    """The strings of a kit, as numbers."""
    return prepare_corpus(task)


def entry(settings: Mapping[str, Any]) -> StringVaeConfig:
    """The entry whose JSON is `settings`."""
    return StringVaeConfig.model_validate(settings)


def learner(task: Task, entry: StringVaeConfig, seed: int) -> StringVaeTask:
    """A string VAE with fresh weights beside the strings of its kit."""
    described, vocabulary, strings = read_corpus(task, task.shard.params["data"])
    device = resolve_device(entry.device)
    canonical = entry.target == "canonical" and described["edges"] != "tree"  # of a tree's graph there are many trees
    header = {
        **{key: described[key] for key in ("names", "edges", "cycles", "most", "patterns", "counts")},
        "canonical": canonical,
        "tokens": list(vocabulary.texts),
        "data": sample_digests(task, "safetensors"),
    }
    module = new_model(entry, vocabulary, described["most"], seed).to(device)
    return StringVaeTask(module, header, entry, vocabulary, canonical, strings["train"], strings["val"])


def new_model(entry: StringVaeConfig, vocabulary: Vocabulary, most: int, seed: int) -> StringVae:
    """A model of strings of at most `most` tokens with random weights, by its seed alone."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        return StringVae(entry, len(vocabulary), vocabulary.cycles, most + 1)


@dataclass(frozen=True)
class StringVaeTask:
    """The `Learner` of a string VAE.

    canonical: whether the decoder learns the canonical string of the graph instead of the one that was read.
    """

    module: StringVae
    header: Mapping[str, Any]
    entry: StringVaeConfig
    vocabulary: Vocabulary
    canonical: bool
    train: StringCorpus
    val: StringCorpus

    def batches(self, rng: np.random.Generator) -> Iterator[StringBatch]:
        """Random batches of train, one pass after another."""
        device = next(self.module.parameters()).device
        while True:
            for batch in self._batches(self.train, rng):
                yield batch.to(device)

    def losses(self, batch: StringBatch, step: int, noise: Generator) -> dict[str, Tensor]:
        """Nats of a string, the divergence from the prior, and the triplet loss where it is asked for."""
        mean, log_variance = self.module.encode(batch.read, batch.read_lengths)
        points = mean + torch.exp(0.5 * log_variance) * _normal(mean, noise)
        shown = shifted(batch.codes)
        hidden = torch.rand(shown.shape, generator=noise, device=shown.device) < self.entry.word_dropout
        logits = self.module.decode(shown, points, batch.open_until, hidden)
        nats, _ = self._reconstruction(logits, batch)
        divergence = _divergence(mean, log_variance)
        losses = {"nats": nats, "divergence": divergence}
        loss = nats + self.entry.kl_weight * annealed(step, self.entry.anneal_steps) * divergence
        if self.entry.triplet_weight:
            losses["triplet"] = triplet_loss(mean, batch.histograms, self.entry.triplet_margin, noise)
            loss = loss + self.entry.triplet_weight * losses["triplet"]
        return {"loss": loss, **losses}

    def validate(self, noise: Generator) -> dict[str, float]:
        """On val, with the weight that the divergence has at the end; `accuracy`: share of the tokens that are the
        likeliest where all before them are right."""
        device = next(self.module.parameters()).device
        val = (each.to(device) for each in self._batches(self.val, None))
        return weighted_means(((self._figures(each, noise), len(each.codes)) for each in val), len(self.val))

    def _figures(self, batch: StringBatch, noise: Generator) -> dict[str, Tensor]:
        mean, log_variance = self.module.encode(batch.read, batch.read_lengths)
        points = mean + torch.exp(0.5 * log_variance) * _normal(mean, noise)
        logits = self.module.decode(shifted(batch.codes), points, batch.open_until)
        nats, accuracy = self._reconstruction(logits, batch)
        divergence = _divergence(mean, log_variance)
        loss = nats + self.entry.kl_weight * divergence
        return {"loss": loss, "nats": nats, "divergence": divergence, "accuracy": accuracy}

    def _batches(self, strings: StringCorpus, rng: np.random.Generator | None) -> Iterator[StringBatch]:
        return batches(strings, self.entry.batch_size, len(self.vocabulary), self.canonical, rng)

    def _reconstruction(self, logits: Tensor, batch: StringBatch) -> tuple[Tensor, Tensor]:
        """Nats of a string, mean over the batch, and the share of the tokens that are the likeliest."""
        if self.entry.decoder != "plain":
            logits = logits.masked_fill(~batch.allowed, -torch.inf)
        there = torch.arange(batch.codes.shape[1]) < batch.lengths[:, None]
        there = there.to(logits.device)
        nats = -torch.log_softmax(logits.float(), dim=-1).gather(-1, batch.codes[..., None])[..., 0]
        right = (logits.argmax(dim=-1) == batch.codes) & there
        return torch.where(there, nats, 0.0).sum() / len(batch.codes), right.sum() / there.sum()


def annealed(step: int, over: int) -> float:
    """The share of its weight that the divergence has at a step: an S from 0 to 1."""
    if not over:
        return 1.0
    return float(1.0 / (1.0 + np.exp(-ANNEAL_STEEPNESS * (step / over - 0.5))))


def triplet_loss(points: Tensor, histograms: Tensor, margin: float, noise: Generator) -> Tensor:
    """The triplet loss (strings §5.3) of points float (n, latent), mean over the batch.

    Each is compared with two others at random; the one that is more similar, by the types of the parts, shall be
    nearer by `margin`, in squared distance. Two that are as similar say nothing.
    """
    first, second = (
        torch.randperm(len(points), generator=noise, device=noise.device).to(points.device) for _ in range(2)
    )
    unlikeness = [histogram_metric(histograms, histograms[other]) for other in (first, second)]
    gaps = [((points - points[other]) ** 2).sum(dim=-1) for other in (first, second)]
    nearer, farther = (
        torch.where(unlikeness[0] < unlikeness[1], gaps[0], gaps[1]),
        torch.where(unlikeness[0] < unlikeness[1], gaps[1], gaps[0]),
    )
    loss: Tensor = (relu(nearer - farther + margin) * (unlikeness[0] != unlikeness[1])).mean()
    return loss


def _divergence(mean: Tensor, log_variance: Tensor) -> Tensor:
    """Of normal distributions from the standard one, in nats of a string, mean over the batch."""
    return 0.5 * (mean**2 + log_variance.exp() - 1.0 - log_variance).sum(dim=-1).mean()


def _normal(like: Tensor, noise: Generator) -> Tensor:
    return torch.randn(like.shape, generator=noise, device=like.device)
