"""Realism of shapes by networks: Fréchet distance of features, and a classifier two-sample test (shapeassembly §7.1.1,
App. E)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn.functional import binary_cross_entropy_with_logits

from eval.engine.table import Cell
from stages.shape.arrays import FloatArray
from stages.training.recovery.clouds import frame_of, subsample
from stages.training.recovery.trained import PRETRAINED_FOLDER, TrainedRecovery, find_models

FEATURES = ("chair", "points")
"""The pretrained recovery model whose encoder gives the features; it was trained on curve chairs alone."""

POINTS_PER_CLOUD = 1024

TRAINING_EPOCHS = 60
AVERAGED_EPOCHS = 10
"""The last epochs, over which the classifier's acceptance is averaged."""


@dataclass(frozen=True)
class TwoSampleScores:
    """Similarity to real shapes."""

    accepted: Cell
    """Percentage that a classifier takes for real; empty for fewer than two shapes."""
    frechet_distance: Cell
    """Of network features; empty without a network, or for fewer than two shapes."""


def two_sample_scores(samples: FloatArray, real: FloatArray, features: FloatArray | None, seed: int) -> TwoSampleScores:
    """Compare clouds (n, k, 3) with equally many real ones (n, k, 3) and their `features_of`.

    The classifier sees every fourth point.
    """
    if min(len(samples), len(real)) < 2:
        return TwoSampleScores("", "")
    own = None if features is None else features_of(samples)
    distance = "" if own is None or features is None else frechet_distance(own, features)
    return TwoSampleScores(classifier_acceptance(samples[:, ::4], real[:, ::4], seed), distance)


def features_of(clouds: FloatArray, folder: Path = PRETRAINED_FOLDER) -> FloatArray | None:
    """Return features float64 (n, d) of clouds (n, k, 3), y up, of any size and position; None without a network.

    d: the widths of the encoder's embedding, its maximum and its mean.
    """
    network = _network(folder)
    if network is None:
        return None
    rng = np.random.default_rng(0)
    features = []
    with torch.no_grad():
        for cloud in clouds:
            points = subsample(cloud, network.entry.points, rng)
            normalized = torch.from_numpy(frame_of(points).normalized(points)[None]).float()
            features.append(network.module.encoder(normalized)[0].double().numpy())
    return np.stack(features)


@lru_cache(maxsize=1)
def _network(folder: Path) -> TrainedRecovery | None:
    """Return the network of the features, read once: all models of the folder are read to find it."""
    return find_models(folder)[0].get(FEATURES)


def frechet_distance(first: FloatArray, second: FloatArray) -> Cell:
    """Return the Fréchet distance of normal distributions fitted to features (n, d) and (m, d), as in FID; empty where
    n or m is 1, since one sample has no covariance.

    It is the squared distance of the means plus `tr(A + B - 2 (AB)^(1/2))` of the covariances A and B.
    """
    if min(len(first), len(second)) < 2:
        return ""
    centred = [(rows - rows.mean(axis=0)) / np.sqrt(len(rows) - 1) for rows in (first, second)]
    of_means = float(((first.mean(axis=0) - second.mean(axis=0)) ** 2).sum())
    # The trace of the root is the sum of the singular values of X Y', which needs no root of a singular matrix.
    common = float(np.linalg.svd(centred[0] @ centred[1].T, compute_uv=False).sum())
    return of_means + sum(float((rows**2).sum()) for rows in centred) - 2 * common


def classifier_acceptance(samples: FloatArray, real: FloatArray, seed: int) -> float:
    """Return the percentage of samples that a classifier takes for real; 50 if it cannot tell them apart.

    A PointNet is trained on one half of the samples (n, k, 3) and equally many real clouds (m, k, 3), and classifies
    the other half. The paper classifies the shapes of its training set, which takes longer and gives smaller values.
    """
    count = min(len(samples), len(real))
    rng = np.random.default_rng(seed)
    subsets = [clouds[rng.permutation(len(clouds))[:count]] for clouds in (samples, real)]
    normalized = [frame_of(cloud).normalized(cloud) for subset in subsets for cloud in subset]
    inputs = torch.from_numpy(np.stack(normalized)).float()
    is_real = torch.arange(2 * count) >= count
    training = torch.arange(2 * count) % count < count // 2
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        classifier = _Classifier()
        optimizer = torch.optim.Adam(classifier.parameters(), 1e-3)
        shares = []
        for epoch in range(TRAINING_EPOCHS):
            classifier.train()
            rows = training.nonzero()[:, 0]
            for batch in rows[torch.randperm(len(rows))].chunk(-(-len(rows) // 32)):
                optimizer.zero_grad()
                loss = binary_cross_entropy_with_logits(classifier(inputs[batch]), is_real[batch].float())
                torch.autograd.backward(loss)
                optimizer.step()
            if epoch >= TRAINING_EPOCHS - AVERAGED_EPOCHS:
                classifier.eval()
                with torch.no_grad():
                    shares.append(float((classifier(inputs[~training & ~is_real]) > 0).float().mean()))
    return 100 * float(np.mean(shares))


class _Classifier(nn.Module):
    """A small PointNet: from clouds (n, k, 3) to logits (n,) of being real."""

    def __init__(self) -> None:
        super().__init__()
        self.points = nn.Sequential(
            nn.Linear(3, 64), nn.ReLU(), nn.Linear(64, 64), nn.ReLU(), nn.Linear(64, 128)
        )  # fmt: skip
        self.verdict = nn.Sequential(nn.Linear(128, 64), nn.ReLU(), nn.Dropout(0.3), nn.Linear(64, 1))

    def forward(self, clouds: Tensor) -> Tensor:
        logits: Tensor = self.verdict(self.points(clouds).amax(dim=1))
        return logits[:, 0]
