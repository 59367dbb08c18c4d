"""How like real shapes shapes are, as networks see them: Fréchet distance of features, and fooling a judge
(shapeassembly §7.1.1, App. E)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn.functional import binary_cross_entropy_with_logits

from eval.engine.table import Cell
from stages.shape.arrays import FloatArray
from stages.training.recovery.clouds import frame_of, subsample
from stages.training.recovery.trained import PRETRAINED_FOLDER, find_models

FEATURES = ("chair", "points")
"""The frozen network whose features are compared is the encoder of the recovery model of this program and input that
comes with Shapemill: it was trained on curve chairs, and on none of the shapes that are compared."""

POINTS = 1024
"""Points of a cloud."""

EPOCHS = 60
JUDGED = 10
"""The judge's verdicts after each of so many last epochs are averaged."""


@dataclass(frozen=True)
class Realism:
    """fool: percent that a judge takes for real. fd: Fréchet distance to real shapes, empty where no network ships."""

    fool: float
    fd: Cell


def realism(samples: FloatArray, real: FloatArray, features: FloatArray | None, seed: int) -> Realism:
    """Of clouds (n, k, 3) beside as many real ones (n, k, 3) with these `features_of`, k best POINTS; the judge sees
    every fourth."""
    own = None if features is None else features_of(samples)
    distance = "" if own is None or features is None else frechet_distance(own, features)
    return Realism(fooled(samples[:, ::4], real[:, ::4], seed), distance)


def features_of(clouds: FloatArray, folder: Path = PRETRAINED_FOLDER) -> FloatArray | None:
    """Features float64 (n, d) of clouds (n, k, 3), y up, any place and size; None where no network ships.

    d: the widths of the encoder's embedding, its maximum and its mean.
    """
    network = find_models(folder)[0].get(FEATURES)
    if network is None:
        return None
    rng = np.random.default_rng(0)
    found = []
    with torch.no_grad():
        for cloud in clouds:
            points = subsample(cloud, network.entry.points, rng)
            seen = torch.from_numpy(frame_of(points).normalized(points)[None]).float()
            found.append(network.module.encoder(seen)[0].double().numpy())
    return np.stack(found)


def frechet_distance(first: FloatArray, second: FloatArray) -> float:
    """Between the normal distributions that features (n, d) and (m, d) have mean and covariance of (FID): the squared
    distance of the means plus `tr(A + B - 2 (AB)^(1/2))` of the covariances."""
    centred = [(each - each.mean(axis=0)) / np.sqrt(len(each) - 1) for each in (first, second)]
    apart = float(((first.mean(axis=0) - second.mean(axis=0)) ** 2).sum())
    # The trace of the root is the sum of the singular values of X Y', which needs no root of a singular matrix.
    common = float(np.linalg.svd(centred[0] @ centred[1].T, compute_uv=False).sum())
    return apart + sum(float((each**2).sum()) for each in centred) - 2 * common


def fooled(samples: FloatArray, real: FloatArray, seed: int) -> float:
    """Percent of samples that a judge takes for real: a PointNet that learns from one half of the samples (n, k, 3) and
    as many real clouds (m, k, 3) and judges the other half; 50 where it cannot tell them apart.

    The paper judges the shapes that it trains on, which needs longer and gives less.
    """
    count = min(len(samples), len(real))
    rng = np.random.default_rng(seed)
    chosen = [each[rng.permutation(len(each))[:count]] for each in (samples, real)]
    clouds = torch.from_numpy(np.stack([frame_of(each).normalized(each) for part in chosen for each in part])).float()
    truth = torch.arange(2 * count) >= count
    learnt = torch.arange(2 * count) % count < count // 2
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        judge = _Judge()
        optimizer = torch.optim.Adam(judge.parameters(), 1e-3)
        shares = []
        for epoch in range(EPOCHS):
            judge.train()
            for batch in learnt.nonzero()[:, 0][torch.randperm(int(learnt.sum()))].chunk(-(-int(learnt.sum()) // 32)):
                optimizer.zero_grad()
                torch.autograd.backward(binary_cross_entropy_with_logits(judge(clouds[batch]), truth[batch].float()))
                optimizer.step()
            if epoch >= EPOCHS - JUDGED:
                judge.eval()
                with torch.no_grad():
                    shares.append(float((judge(clouds[~learnt & ~truth]) > 0).float().mean()))
    return 100 * float(np.mean(shares))


class _Judge(nn.Module):
    """A small PointNet: clouds (n, k, 3) to logits (n,) of being real."""

    def __init__(self) -> None:
        super().__init__()
        self.points = nn.Sequential(
            nn.Linear(3, 64), nn.ReLU(), nn.Linear(64, 64), nn.ReLU(), nn.Linear(64, 128)
        )  # fmt: skip
        self.verdict = nn.Sequential(nn.Linear(128, 64), nn.ReLU(), nn.Dropout(0.3), nn.Linear(64, 1))

    def forward(self, clouds: Tensor) -> Tensor:
        logits: Tensor = self.verdict(self.points(clouds).amax(dim=1))
        return logits[:, 0]
