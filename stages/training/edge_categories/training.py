"""Training a model of edge categories: the loss and what is looked at (strings §6)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Generator, Tensor
from torch.nn.functional import cross_entropy

from pipeline.stage import Outcome, Task
from stages.training.edge_categories.batches import CategoryBatch, CategoryTables, LabelledStrings, batches
from stages.training.edge_categories.corpus import prepare_corpus, read_corpus
from stages.training.edge_categories.model import EdgeCategoriesModel, make_model, masked
from stages.training.edge_categories.settings import EdgeCategoriesConfig
from stages.training.loop import resolve_device
from stages.training.training_task import sample_digests


def prepare(task: Task) -> Outcome:
    """The strings of a kit's shapes with their categories."""
    return prepare_corpus(task)


def entry(settings: Mapping[str, Any]) -> EdgeCategoriesConfig:
    """The entry whose JSON is `settings`."""
    return EdgeCategoriesConfig.model_validate(settings)


def learner(task: Task, entry: EdgeCategoriesConfig, seed: int) -> EdgeCategoriesTask:
    """A model with fresh weights beside the strings of its kit."""
    described, tables, strings = read_corpus(task, task.shard.params["data"])
    header = {**described, "data": sample_digests(task, "rows")}
    module = new_model(entry, tables, described["cycles"], seed).to(resolve_device(entry.device))
    return EdgeCategoriesTask(module, header, entry, tables, strings["train"], strings["val"])


def new_model(entry: EdgeCategoriesConfig, tables: CategoryTables, cycles: int, seed: int) -> EdgeCategoriesModel:
    """A model with random weights, by its seed alone."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        return make_model(entry, tables, cycles)


@dataclass(frozen=True)
class EdgeCategoriesTask:
    """The `Learner` of a model of edge categories."""

    module: EdgeCategoriesModel
    header: Mapping[str, Any]
    entry: EdgeCategoriesConfig
    tables: CategoryTables
    train: LabelledStrings
    val: LabelledStrings

    def batches(self, rng: np.random.Generator) -> Iterator[CategoryBatch]:
        """Random batches of train, one pass after another."""
        device = next(self.module.parameters()).device
        while True:
            for batch in batches(self.train, self.entry.batch_size, self.tables.masks, rng):
                yield batch.to(device)

    def losses(self, batch: CategoryBatch, step: int, noise: Generator) -> dict[str, Tensor]:
        """Nats of a token, and the share of the tokens of edges that are right."""
        right, nats = self._judge(batch)
        return {"loss": nats.mean(), "accuracy": right[is_open(batch)].float().mean()}

    def validate(self, noise: Generator) -> dict[str, float]:
        """On val, shares of what is right, where a walker sees the right ones before each. `accuracy`: of the tokens
        that may have more than one category; `tokens`: of all, as published; `strings`: of strings with none wrong."""
        device = next(self.module.parameters()).device
        sums = dict.fromkeys(("nats", "right", "open", "sure", "tokens", "strings"), 0.0)
        for batch in (each.to(device) for each in batches(self.val, self.entry.batch_size, self.tables.masks, None)):
            right, nats = self._judge(batch)
            there, undecided = batch.there_is, is_open(batch)
            found = {
                "nats": nats.sum(), "right": right[there].sum(), "tokens": there.sum(),
                "sure": right[undecided].sum(), "open": undecided.sum(), "strings": (right | ~there).all(dim=1).sum(),
            }  # fmt: skip
            for name, value in found.items():
                sums[name] += float(value)
        return {
            "loss": sums["nats"] / sums["tokens"],
            "accuracy": sums["sure"] / max(sums["open"], 1.0),
            "tokens": sums["right"] / sums["tokens"],
            "strings": sums["strings"] / len(self.val),
        }

    def _judge(self, batch: CategoryBatch) -> tuple[Tensor, Tensor]:
        """Whether the likeliest category of each token is right, bool (n, longest), and the nats of those that are
        there, float (tokens,)."""
        logits = self.module(batch).float()
        if self.entry.mask:
            logits = masked(logits, batch.allowed)
        there = batch.there_is
        nats = cross_entropy(logits[there], batch.categories[there], reduction="none")
        return logits.argmax(dim=-1) == batch.categories, nats


def is_open(batch: CategoryBatch) -> Tensor:
    """Tokens that may have more than one category, bool (n, longest)."""
    return (batch.allowed.sum(dim=-1) > 1) & batch.there_is
