"""Train a model of edge categories: loss and accuracy (strings §6)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from torch import Generator, Tensor
from torch.nn.functional import cross_entropy

from pipeline.stage import Task
from stages.training.corpus import read_description
from stages.training.edge_categories.batches import CategoryBatch, CategoryTables, LabelledStrings, batches
from stages.training.edge_categories.corpus import prepare, read_corpus
from stages.training.edge_categories.model import EdgeCategoriesModel, make_model, masked
from stages.training.edge_categories.settings import EdgeCategoriesConfig
from stages.training.kind import Kind
from stages.training.training_task import TrainingTask, seeded


@dataclass(frozen=True)
class EdgeCategoriesTask(TrainingTask):
    """Training of a model of edge categories."""

    tables: CategoryTables

    def epoch(self, samples: LabelledStrings, rng: np.random.Generator | None) -> Iterator[CategoryBatch]:
        return batches(samples, self.config.batch_size, self.tables.masks, rng)

    def losses(self, batch: CategoryBatch, step: int, noise: Generator) -> dict[str, Tensor]:
        """Compute the nats of a token, and the accuracy at tokens with more than one allowed category."""
        right, nats = self._classify(batch)
        return {"loss": nats.mean(), "accuracy": right[is_open(batch)].float().mean()}

    def validate(self, noise: Generator) -> dict[str, float]:
        """Compute accuracies on val; an autoregressive decoder sees the right categories before each token.

        `accuracy`: of tokens with more than one allowed category.
        `tokens`: of all tokens, as published.
        `strings`: share of strings without an error.
        """
        sums = dict.fromkeys(("nats", "right", "open", "open_right", "tokens", "strings"), 0.0)
        for batch in self._on_device(self.epoch(self.val, None)):
            right, nats = self._classify(batch)
            is_token, undecided = batch.is_token, is_open(batch)
            counts = {
                "nats": nats.sum(),
                "right": right[is_token].sum(),
                "tokens": is_token.sum(),
                "open_right": right[undecided].sum(),
                "open": undecided.sum(),
                "strings": (right | ~is_token).all(dim=1).sum(),
            }
            for name, value in counts.items():
                sums[name] += float(value)
        return {
            "loss": sums["nats"] / sums["tokens"],
            "accuracy": sums["open_right"] / max(sums["open"], 1.0),
            "tokens": sums["right"] / sums["tokens"],
            "strings": sums["strings"] / len(self.val),
        }

    def _classify(self, batch: CategoryBatch) -> tuple[Tensor, Tensor]:
        """Return whether each token's likeliest category is right, bool (n, longest), and nats, float (tokens,)."""
        logits = self.module(batch).float()
        if self.config.mask:
            logits = masked(logits, batch.allowed)
        nats = cross_entropy(logits[batch.is_token], batch.categories[batch.is_token], reduction="none")
        return logits.argmax(dim=-1) == batch.categories, nats


def new_task(task: Task, config: EdgeCategoriesConfig, seed: int) -> EdgeCategoriesTask:
    description = read_description(task)
    tables, strings = read_corpus(task)
    module = new_model(config, tables, description["cycles"], seed)
    return EdgeCategoriesTask.of(task, config, module, strings, description, "rows", tables=tables)


def new_model(config: EdgeCategoriesConfig, tables: CategoryTables, cycles: int, seed: int) -> EdgeCategoriesModel:
    return seeded(seed, lambda: make_model(config, tables, cycles))


def is_open(batch: CategoryBatch) -> Tensor:
    """Return the tokens with more than one allowed category, bool (n, longest)."""
    return (batch.allowed.sum(dim=-1) > 1) & batch.is_token


KIND = Kind(EdgeCategoriesConfig, prepare, new_task)
