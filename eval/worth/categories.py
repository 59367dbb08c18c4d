"""Whether a network that learnt what a part is tells categories, by a linear classifier of whole clouds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch

from stages.shape.arrays import FloatArray
from stages.training.point_encoder.clouds import LabelledClouds
from stages.training.point_encoder.network import PointEncoder

DESCRIBED_POINTS = 1024
DESCRIBED_TOGETHER = 16
RIDGE_WEIGHT = 0.1
"""Weight of the squared weights of the classifier, against the mean squared error, with features of deviation 1."""


def tells_categories(
    encoder: PointEncoder, learnt: Sequence[tuple[str, LabelledClouds]], tested: Sequence[tuple[str, LabelledClouds]]
) -> FloatArray:
    """Return for each tested cloud 100 if its category is told, else 0, float64 (n,). The encoder stays as it is.

    learnt, tested: clouds with their category; there are at least two categories, and each is learnt.
    """
    features, labels = _described(encoder, learnt)
    middle, deviation = features.mean(axis=0), features.std(axis=0) + 1e-6
    names = sorted(set(labels))
    answers = np.array([[float(name == label) for name in names] for label in labels])
    scaled = (features - middle) / deviation
    ridge = RIDGE_WEIGHT * len(scaled) * np.eye(scaled.shape[1])
    share = answers.mean(axis=0)
    weights = np.linalg.solve(scaled.T @ scaled + ridge, scaled.T @ (answers - share))
    features, labels = _described(encoder, tested)
    answered = np.argmax((features - middle) / deviation @ weights + share, axis=1)
    return np.array([100.0 * (names[best] == label) for best, label in zip(answered, labels, strict=True)])


def _described(encoder: PointEncoder, sets: Sequence[tuple[str, LabelledClouds]]) -> tuple[FloatArray, list[str]]:
    """Return the descriptions of all clouds, float64 (n, features), and the category of each."""
    features = []
    with torch.no_grad():
        for _, clouds in sets:
            points = torch.from_numpy(clouds.points[:, :DESCRIBED_POINTS])
            features += [encoder.describe(some).double().numpy() for some in torch.split(points, DESCRIBED_TOGETHER)]
    return np.concatenate(features), [category for category, clouds in sets for _ in range(len(clouds))]
