"""Train a language model of programs: the nats of each word given those before."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import torch
from torch import Generator, Tensor
from torch.nn.functional import cross_entropy

from pipeline.stage import Task
from stages.shape.arrays import FloatArray
from stages.training.corpus import read_arrays, read_description, read_splits
from stages.training.kind import Kind
from stages.training.program_lm.batches import WordBatch, WordCorpus, batches
from stages.training.program_lm.corpus import prepare
from stages.training.program_lm.model import ProgramLm
from stages.training.program_lm.settings import ProgramLmConfig
from stages.training.program_lm.tokens import NUMBER_STEPS, VOCABULARY_SIZE
from stages.training.training_task import TrainingTask, seeded

FIRST_NUMBER_WORD = VOCABULARY_SIZE - NUMBER_STEPS - 1


@dataclass(frozen=True)
class ProgramLmTask(TrainingTask):
    """Training of a language model of programs."""

    def epoch(self, samples: WordCorpus, rng: np.random.Generator | None) -> Iterator[WordBatch]:
        return batches(samples, self.config.batch_size, rng)

    def losses(self, batch: WordBatch, step: int, noise: Generator) -> dict[str, Tensor]:
        """Compute the mean nats of a program, and of its numbers; inputs are jittered."""
        return self._nats(batch, jittered(batch.before, self.config.jitter, noise))

    def validation_losses(self, batch: WordBatch, noise: Generator) -> dict[str, Tensor]:
        """Compute the same without jitter."""
        return self._nats(batch, batch.before)

    def _nats(self, batch: WordBatch, before: Tensor) -> dict[str, Tensor]:
        logits = self.module(before, batch.cues, batch.sizes, batch.places)
        words = batch.words.flatten()[batch.places]
        nats = cross_entropy(logits, words, reduction="none")
        numbers = (nats * (words >= FIRST_NUMBER_WORD)).sum() / len(batch)
        return {"loss": nats.sum() / len(batch), "numbers": numbers}


def new_task(task: Task, config: ProgramLmConfig, seed: int) -> ProgramLmTask:
    description, values = read_description(task), read_arrays(task, "values")["values"]
    module = new_model(config, values, description["longest"], seed)
    return ProgramLmTask.of(task, config, module, read_splits(task, WordCorpus), description)


def new_model(config: ProgramLmConfig, values: FloatArray, longest: int, seed: int) -> ProgramLm:
    """Build a model of programs of at most `longest` words with random weights."""
    module = seeded(seed, lambda: ProgramLm(config, longest))
    module.values.copy_(torch.from_numpy(values))
    return module


def jittered(before: Tensor, share: float, noise: Generator) -> Tensor:
    """Shift a share of the numbers among input words, int64 (n, longest), by one step up or down.

    Sampled programs seldom repeat training numbers exactly.
    """
    uniform = torch.rand(before.shape, generator=noise, device=before.device)
    shifted = before + torch.where(uniform < share / 2, -1, 1)
    numbers = (before >= FIRST_NUMBER_WORD) & (uniform < share)
    return torch.where(numbers, shifted.clamp(FIRST_NUMBER_WORD, VOCABULARY_SIZE - 1), before)


KIND = Kind(ProgramLmConfig, prepare, new_task)
