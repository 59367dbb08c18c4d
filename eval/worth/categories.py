"""Whether a network that learnt what a part is describes categories: a linear probe of its descriptions of clouds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch

from eval.worth.real_sets import TESTED_POINTS
from stages.shape.arrays import FloatArray
from stages.training.point_encoder.clouds import LabelledClouds
from stages.training.point_encoder.network import PointEncoder

CLOUDS_PER_BATCH = 16
RIDGE_WEIGHT = 0.1
"""Weight of the squared weights of the probe, against the mean squared error, with features of deviation 1."""

CategoryClouds = Sequence[tuple[str, LabelledClouds]]
"""Sets of clouds, each with its category."""


def category_hits(encoder: PointEncoder, labelled: CategoryClouds, tested: CategoryClouds) -> FloatArray:
    """Return for each tested cloud 100 if a linear probe finds its category, else 0, float64 (n,).

    The probe, a ridge regression, learns from the labelled clouds; the encoder, in evaluation mode, does not.
    labelled: at least two categories, all that are tested.
    """
    features, labels = _described(encoder, labelled)
    middle, deviation = features.mean(axis=0), features.std(axis=0) + 1e-6
    names = sorted(set(labels))
    answers = np.array([[float(name == label) for name in names] for label in labels])
    scaled = (features - middle) / deviation
    ridge = RIDGE_WEIGHT * len(scaled) * np.eye(scaled.shape[1])
    share = answers.mean(axis=0)
    weights = np.linalg.solve(scaled.T @ scaled + ridge, scaled.T @ (answers - share))
    features, labels = _described(encoder, tested)
    found = np.argmax((features - middle) / deviation @ weights + share, axis=1)
    return np.array([100.0 * (names[best] == label) for best, label in zip(found, labels, strict=True)])


def _described(encoder: PointEncoder, sets: CategoryClouds) -> tuple[FloatArray, list[str]]:
    """Return the descriptions of all clouds, float64 (n, features), and the category of each."""
    features = []
    with torch.no_grad():
        for _, clouds in sets:
            points = torch.from_numpy(clouds.points[:, :TESTED_POINTS])
            features += [encoder.describe(batch).double().numpy() for batch in torch.split(points, CLOUDS_PER_BATCH)]
    return np.concatenate(features), [category for category, clouds in sets for _ in range(len(clouds))]
