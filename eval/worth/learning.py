"""Learn which points belong to one part, and how well a network tells it of other shapes."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from copy import deepcopy
from dataclasses import dataclass
from itertools import islice

import numpy as np
import torch
from torch import Generator, Tensor

from eval.worth.augmentation import Augmentation, augmented_cloud
from eval.worth.labelled_clouds import LabelledClouds
from eval.worth.network import PointEncoder, near_point_pairs, same_part_loss, squared_distances
from stages.shape.arrays import BoolArray, FloatArray
from stages.training.loop import TrainState, train
from stages.training.model_config import ModelConfig
from stages.training.training_task import TrainingTask, seeded

POINTS_PER_CLOUD = 1024
POINTS_IN_PAIRS = 256
"""Random points of each cloud whose pairs a step learns from."""
TESTED_POINTS_IN_PAIRS = 512
CLOUDS_PER_STEP = 4
LEARNING_RATE = 3e-3

Batch = tuple[Tensor, Tensor, Tensor]
"""Points float (n, k, 3), parts int (n, k), and the points whose pairs count, int (m,)."""


@dataclass(frozen=True)
class SamePartTask(TrainingTask):
    """A `PointEncoder` that learns from `LabelledClouds`, augmented in some ways."""

    ways: Collection[Augmentation] = ()

    def batches(self, rng: np.random.Generator) -> Iterator[Batch]:
        """Yield batches of clouds in random order, each with `POINTS_PER_CLOUD` of its points, without end."""
        clouds: LabelledClouds = self.train
        order = _endless_order(len(clouds), rng)
        while True:
            augmented = []
            for index in islice(order, self.config.batch_size):
                drawn = rng.permutation(clouds.points.shape[1])[:POINTS_PER_CLOUD]
                augmented.append(
                    augmented_cloud(clouds.points[index, drawn], clouds.parts[index, drawn], self.ways, rng)
                )
            points, parts = (torch.from_numpy(np.stack(arrays)) for arrays in zip(*augmented, strict=True))
            yield points, parts, torch.from_numpy(rng.permutation(points.shape[1])[:POINTS_IN_PAIRS])

    def losses(self, batch: Batch, step: int, noise: Generator) -> dict[str, Tensor]:
        """Compute the cross entropy of the pairs of a batch."""
        return {"loss": same_part_loss(self.module, *batch)}


def _endless_order(count: int, rng: np.random.Generator) -> Iterator[int]:
    while True:
        yield from rng.permutation(count).tolist()


def new_encoder(seed: int) -> PointEncoder:
    """Return an encoder with random weights."""
    return seeded(seed, PointEncoder).eval()


def trained_encoder(
    encoder: PointEncoder,
    clouds: LabelledClouds,
    steps: int,
    rng: np.random.Generator,
    ways: Collection[Augmentation] = (),
    progress: Callable[[int, int], None] = lambda done, steps: None,
) -> PointEncoder:
    """Return a copy of an encoder after `steps` further steps on clouds of at least `POINTS_PER_CLOUD` points."""
    config = ModelConfig(
        name="worth",
        steps=steps,
        max_rounds=1,
        batch_size=CLOUDS_PER_STEP,
        learning_rate=LEARNING_RATE,
        device="cpu",
        precision="float32",
    )
    task = SamePartTask(deepcopy(encoder), {}, config, clouds, None, ways)
    with torch.random.fork_rng(devices=[]):
        train(TrainState.of(task), rng, progress)
    learnt: PointEncoder = task.module.eval()
    return learnt


def precision_of_encoder(encoder: PointEncoder, clouds: LabelledClouds) -> FloatArray:
    """Return the `average_precision` of near pairs of each cloud, percent, float64 (n,): close in embedding first."""

    def embeddings(points: Tensor) -> Tensor:
        with torch.no_grad():
            embedded: Tensor = encoder(points)
        return embedded

    return _precision_of_clouds(embeddings, clouds)


def precision_of_distance(clouds: LabelledClouds) -> FloatArray:
    """Return the same for pairs that lie close together first, without a network."""
    return _precision_of_clouds(lambda points: points, clouds)


def _precision_of_clouds(embeddings: Callable[[Tensor], Tensor], clouds: LabelledClouds) -> FloatArray:
    count = TESTED_POINTS_IN_PAIRS
    precisions = []
    for index in range(len(clouds)):
        points, parts = torch.from_numpy(clouds.points[index : index + 1]), clouds.parts[index, :count]
        near = near_point_pairs(points[:, :count])[0].numpy()
        distances = squared_distances(embeddings(points)[:, :count].double())[0].numpy()
        same = parts[:, None] == parts
        precisions.append(100.0 * average_precision(-distances[near], same[near]))
    return np.array(precisions)


def average_precision(scores: FloatArray, positive: BoolArray) -> float:
    """Return the mean, over the positives, of the precision of all pairs with at least their score.

    scores: float (n,); positive: bool (n,). Without positives it is 0. Equal scores are in any order.
    """
    hits = positive[np.argsort(-scores, kind="stable")]
    if not hits.any():
        return 0.0
    precisions = np.cumsum(hits) / np.arange(1, len(hits) + 1)
    return float(precisions[hits].mean())
