"""Train an encoder of clouds: the cross entropy of "these two points are of one part"."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice

import numpy as np
import torch
from torch import Generator, Tensor

from pipeline.stage import Task
from stages.training.corpus import read_description, read_splits
from stages.training.kind import Kind
from stages.training.point_encoder.augmentation import augmented_cloud
from stages.training.point_encoder.clouds import LabelledClouds, prepare
from stages.training.point_encoder.network import PointEncoder, same_part_loss
from stages.training.point_encoder.settings import PointEncoderConfig
from stages.training.training_task import TrainingTask, seeded

POINTS_IN_PAIRS = 384
"""Points of each cloud whose pairs a step learns from."""

Batch = list[Tensor]
"""Points float (n, k, 3), parts int (n, k), and the points whose pairs count, int (m,)."""


@dataclass(frozen=True)
class PointEncoderTask(TrainingTask):
    """Training of a `PointEncoder` on `LabelledClouds`."""

    def batches(self, rng: np.random.Generator) -> Iterator[Batch]:
        """Yield batches of augmented clouds in random order, without end, on the device."""
        return self._on_device(self._random_batches(rng))

    def epoch(self, samples: LabelledClouds, rng: np.random.Generator | None) -> Iterator[Batch]:
        """Yield all clouds once, without augmentation, in their order."""
        points = min(self.config.points, samples.points.shape[1])
        chosen = torch.arange(min(points, POINTS_IN_PAIRS))
        for first in range(0, len(samples), self.config.batch_size):
            rows = slice(first, first + self.config.batch_size)
            clouds, parts = samples.points[rows, :points], samples.parts[rows, :points]
            yield [torch.from_numpy(clouds), torch.from_numpy(parts), chosen]

    def losses(self, batch: Batch, step: int, noise: Generator) -> dict[str, Tensor]:
        """Compute the cross entropy of the near pairs of a batch."""
        return {"loss": same_part_loss(self.module, *batch)}

    def _random_batches(self, rng: np.random.Generator) -> Iterator[Batch]:
        clouds: LabelledClouds = self.train
        order = _endless_order(len(clouds), rng)
        while True:
            points, parts = [], []
            for index in islice(order, self.config.batch_size):
                drawn = rng.permutation(clouds.points.shape[1])[: self.config.points]
                cloud, part = clouds.points[index, drawn], clouds.parts[index, drawn]
                cloud, part = augmented_cloud(cloud, part, self.config.augmentation, rng)
                points.append(cloud)
                parts.append(part)
            chosen = rng.permutation(len(points[0]))[:POINTS_IN_PAIRS]
            yield [torch.from_numpy(np.stack(points)), torch.from_numpy(np.stack(parts)), torch.from_numpy(chosen)]


def _endless_order(count: int, rng: np.random.Generator) -> Iterator[int]:
    while True:
        yield from rng.permutation(count).tolist()


def new_task(task: Task, config: PointEncoderConfig, seed: int) -> PointEncoderTask:
    samples = read_splits(task, LabelledClouds)
    return PointEncoderTask.of(task, config, new_model(seed), samples, read_description(task))


def new_model(seed: int) -> PointEncoder:
    """Return an encoder with random weights."""
    return seeded(seed, PointEncoder)


KIND = Kind(PointEncoderConfig, prepare, new_task)
