"""Let an encoder learn which points belong to one part, and measure how well it tells it of other shapes."""

from __future__ import annotations

from collections.abc import Callable, Collection
from copy import deepcopy

import numpy as np
import torch
from torch import Tensor

from stages.shape.arrays import BoolArray, FloatArray
from stages.training.loop import TrainState, train
from stages.training.point_encoder.clouds import LabelledClouds
from stages.training.point_encoder.network import PointEncoder, near_point_pairs, squared_distances
from stages.training.point_encoder.settings import Augmentation, PointEncoderConfig
from stages.training.point_encoder.training import PointEncoderTask

TESTED_POINTS_IN_PAIRS = 512
FIRST_LEARNING_RATE: float = PointEncoderConfig.model_fields["learning_rate"].default
FINE_TUNING_LEARNING_RATE = 1e-3
"""Initial rate of Adam for a network that has learnt already: with that of a first training it forgets."""


def trained_encoder(
    encoder: PointEncoder,
    clouds: LabelledClouds,
    steps: int,
    rng: np.random.Generator,
    ways: Collection[Augmentation] = (),
    learning_rate: float = FIRST_LEARNING_RATE,
    on_step: Callable[[], None] = lambda: None,
) -> PointEncoder:
    """Return a copy of an encoder after `steps` further steps on clouds, in evaluation mode."""
    config = PointEncoderConfig(
        name="worth",
        kind="point_encoder",
        steps=steps,
        max_rounds=1,
        device="cpu",
        augmentation=tuple(ways),
        learning_rate=learning_rate,
    )
    task = PointEncoderTask(deepcopy(encoder), {}, config, clouds, None)
    with torch.random.fork_rng(devices=[]):
        train(TrainState.of(task), rng, lambda done, steps: on_step())
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
