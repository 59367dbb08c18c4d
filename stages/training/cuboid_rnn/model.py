"""A GRU that says of each cuboid of which kind it is, and of each of its axes a mixture of Gaussians (3D-PRNN)."""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn
from torch.nn.functional import softplus

from stages.training.cuboid_rnn.batches import FLAG_COUNT, INPUT_WIDTH, KIND_COUNT, NUMBERS_PER_STEP
from stages.training.cuboid_rnn.settings import CuboidRnnConfig

MIN_DEVIATION = 0.01
"""Least standard deviation of a Gaussian: numbers that recur would make it endlessly narrow."""


class CuboidRnn(nn.Module):
    """Steps of cuboids, one behind the other."""

    def __init__(self, entry: CuboidRnnConfig) -> None:
        super().__init__()
        self.mixtures = entry.mixtures
        self.reader = nn.GRU(INPUT_WIDTH, entry.hidden, batch_first=True)
        self.kinds = nn.Linear(entry.hidden, KIND_COUNT)
        self.said = nn.Sequential(
            nn.Linear(entry.hidden + FLAG_COUNT, entry.hidden),
            nn.LeakyReLU(0.2),
            nn.Linear(entry.hidden, entry.mixtures * (1 + 2 * NUMBERS_PER_STEP)),
        )

    def read(self, shown: Tensor, state: Tensor | None = None) -> tuple[Tensor, Tensor]:
        """The states behind what is `shown`, float (n, steps, SHOWN), in which each step is written: float (n, steps,
        hidden), and the last of them, (1, n, hidden)."""
        states, last = self.reader(shown, state)
        return states, last

    def numbers(self, states: Tensor, flags: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """The logits of the Gaussians (n, steps, mixtures), their means and deviations (n, steps, mixtures, NUMBERS),
        of cuboids with these flags, float (n, steps, FLAGS)."""
        found = self.said(torch.cat([states, flags], dim=-1)).float()
        weights, rest = found.split([self.mixtures, 2 * NUMBERS_PER_STEP * self.mixtures], dim=-1)
        means, deviations = rest.view(*rest.shape[:2], self.mixtures, 2 * NUMBERS_PER_STEP).chunk(2, dim=-1)
        return weights, means, softplus(deviations) + MIN_DEVIATION


def log_density(weights: Tensor, means: Tensor, deviations: Tensor, numbers: Tensor, turned: Tensor) -> Tensor:
    """Logarithm of the density of numbers (n, steps, NUMBERS), float (n, steps); the turn counts where a cuboid is
    `turned`, float (n, steps)."""
    away = (numbers[:, :, None] - means) / deviations
    each = -0.5 * away**2 - torch.log(deviations) - 0.5 * math.log(2 * math.pi)
    joint = each[..., 0] + each[..., 1] + turned[..., None] * each[..., 2]
    return torch.logsumexp(torch.log_softmax(weights, dim=-1) + joint, dim=-1)
