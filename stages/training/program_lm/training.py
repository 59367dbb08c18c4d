"""How a language model of programs learns: the nats of each word after those before it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Generator, Tensor
from torch.nn.functional import cross_entropy

from pipeline.stage import Outcome, Task
from stages.shape.arrays import FloatArray
from stages.training.loop import resolve_device
from stages.training.program_lm.batches import WordBatch, WordCorpus, batches
from stages.training.program_lm.corpus import prepare_corpus, read_corpus
from stages.training.program_lm.model import ProgramLm
from stages.training.program_lm.settings import ProgramLmConfig
from stages.training.program_lm.tokens import NUMBER_STEPS, VOCABULARY_SIZE
from stages.training.training_task import sample_digests, weighted_means

FIRST_NUMBER_WORD = VOCABULARY_SIZE - NUMBER_STEPS - 1


def prepare(task: Task) -> Outcome:
    """The programs of a category, as words."""
    return prepare_corpus(task)


def entry(settings: Mapping[str, Any]) -> ProgramLmConfig:
    """The entry whose JSON is `settings`."""
    return ProgramLmConfig.model_validate(settings)


def learner(task: Task, entry: ProgramLmConfig, seed: int) -> ProgramLmTask:
    """A model with fresh weights beside the programs of its category."""
    described, values, texts = read_corpus(task, task.shard.params["data"])
    header = {**described, "data": sample_digests(task, "safetensors")}
    module = new_model(entry, values, described["longest"], seed).to(resolve_device(entry.device))
    return ProgramLmTask(module, header, entry, texts["train"], texts["val"])


def new_model(entry: ProgramLmConfig, values: FloatArray, longest: int, seed: int) -> ProgramLm:
    """A model with random weights, by its seed alone, of programs of at most `longest` words."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        module = ProgramLm(entry, longest)
    module.values.copy_(torch.from_numpy(values))
    return module


@dataclass(frozen=True)
class ProgramLmTask:
    """The `Learner` of a language model of programs."""

    module: ProgramLm
    header: Mapping[str, Any]
    entry: ProgramLmConfig
    train: WordCorpus
    val: WordCorpus

    def batches(self, rng: np.random.Generator) -> Iterator[WordBatch]:
        """Random batches of train, one pass after another."""
        device = next(self.module.parameters()).device
        while True:
            for batch in batches(self.train, self.entry.batch_size, rng):
                yield batch.to(device)

    def losses(self, batch: WordBatch, step: int, noise: Generator) -> dict[str, Tensor]:
        """Nats of a program, in the mean; of them those of its numbers."""
        return self._nats(batch, jittered(batch.before, self.entry.jitter, noise))

    def validate(self, noise: Generator) -> dict[str, float]:
        """The same on val, nothing jittered."""
        device = next(self.module.parameters()).device
        val = (batch.to(device) for batch in batches(self.val, self.entry.batch_size, None))
        return weighted_means(((self._nats(each, each.before), len(each.words)) for each in val), len(self.val))

    def _nats(self, batch: WordBatch, before: Tensor) -> dict[str, Tensor]:
        logits = self.module(before, batch.cues, batch.seen, batch.places)
        words = batch.words.flatten()[batch.places]
        nats = cross_entropy(logits, words, reduction="none")
        loss = nats.sum() / len(batch.words)
        return {"loss": loss, "numbers": (nats * (words >= FIRST_NUMBER_WORD)).sum() / len(batch.words)}


def jittered(before: Tensor, share: float, noise: Generator) -> Tensor:
    """Words before each, int64 (n, longest), of whose numbers a share is a step lower or higher: what is written later
    is seldom just what was read."""
    drawn = torch.rand(before.shape, generator=noise, device=before.device)
    moved = before + torch.where(drawn < share / 2, -1, 1)
    numbers = (before >= FIRST_NUMBER_WORD) & (drawn < share)
    return torch.where(numbers, moved.clamp(FIRST_NUMBER_WORD, VOCABULARY_SIZE - 1), before)
