"""A GRU that predicts each cuboid's kind, and a mixture of Gaussians for each of its axes (3D-PRNN)."""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn
from torch.nn.functional import softplus

from stages.training.cuboid_rnn.batches import FLAG_COUNT, INPUT_WIDTH, KIND_COUNT, NUMBERS_PER_STEP
from stages.training.cuboid_rnn.settings import CuboidRnnConfig

MIN_DEVIATION = 0.01
"""Minimum standard deviation of a Gaussian: recurring numbers would make it collapse."""


class CuboidRnn(nn.Module):
    """A sequence model over the steps of cuboids."""

    def __init__(self, config: CuboidRnnConfig) -> None:
        super().__init__()
        self.mixtures = config.mixtures
        self.reader = nn.GRU(INPUT_WIDTH, config.hidden, batch_first=True)
        self.kinds = nn.Linear(config.hidden, KIND_COUNT)
        self.gaussians = nn.Sequential(
            nn.Linear(config.hidden + FLAG_COUNT, config.hidden),
            nn.LeakyReLU(0.2),
            nn.Linear(config.hidden, config.mixtures * (1 + 2 * NUMBERS_PER_STEP)),
        )

    def read(self, inputs: Tensor, state: Tensor | None = None) -> tuple[Tensor, Tensor]:
        """Return the state after each input, float (n, steps, hidden), and the last one, float (1, n, hidden).

        inputs: float (n, steps, INPUT_WIDTH).
        """
        states, last = self.reader(inputs, state)
        return states, last

    def numbers(self, states: Tensor, flags: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Return the logits of the mixture (n, steps, mixtures), means and deviations (n, steps, mixtures, 3).

        flags: float (n, steps, FLAG_COUNT).
        """
        outputs = self.gaussians(torch.cat([states, flags], dim=-1)).float()
        weights, rest = outputs.split([self.mixtures, 2 * NUMBERS_PER_STEP * self.mixtures], dim=-1)
        means, deviations = rest.view(*rest.shape[:2], self.mixtures, 2 * NUMBERS_PER_STEP).chunk(2, dim=-1)
        return weights, means, softplus(deviations) + MIN_DEVIATION


def log_density(weights: Tensor, means: Tensor, deviations: Tensor, numbers: Tensor, rotated: Tensor) -> Tensor:
    """Return the log-density of numbers, float (n, steps).

    numbers: float (n, steps, NUMBERS_PER_STEP).
    rotated: float (n, steps), 1 where the rotation counts.
    """
    scaled = (numbers[:, :, None] - means) / deviations
    single = -0.5 * scaled**2 - torch.log(deviations) - 0.5 * math.log(2 * math.pi)
    joint = single[..., 0] + single[..., 1] + rotated[..., None] * single[..., 2]
    return torch.logsumexp(torch.log_softmax(weights, dim=-1) + joint, dim=-1)
