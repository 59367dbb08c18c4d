"""Latent spaces: a Gaussian fitted to the aggregate posterior, from which new points are drawn."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import numpy.typing as npt
import torch
from torch import Generator, Tensor, nn

LatentPoints = npt.NDArray[np.float32]
"""Points of a latent space, float32 (n, latent)."""


class LatentGaussian(nn.Module):
    """A module with a latent space and a Gaussian in it: `center + covariance_root @ noise`, at first the prior.

    center: float32 (latent,).
    covariance_root: float32 (latent, latent).
    """

    center: Tensor
    covariance_root: Tensor

    def __init__(self, latent: int) -> None:
        super().__init__()
        self.register_buffer("center", torch.zeros(latent))
        self.register_buffer("covariance_root", torch.eye(latent))

    def encode(self, batch: Any) -> tuple[Tensor, Tensor]:
        """Encode a batch: mean and logarithm of the variance, float (n, latent) each."""
        raise NotImplementedError

    def set_gaussian(self, means: LatentPoints, variances: LatentPoints) -> None:
        """Set the Gaussian to mean and covariance of the aggregate posterior of samples.

        means, variances: of the posterior of each sample, float32 (n, latent). Values that are not finite change
        nothing: the training loop reports the divergence.
        """
        if not (np.isfinite(means).all() and np.isfinite(variances).all()):
            return
        covariance = np.cov(means.T.astype(np.float64), bias=True).reshape(2 * [means.shape[1]])
        values, axes = np.linalg.eigh(covariance + np.diag(variances.mean(axis=0, dtype=np.float64)))
        self.center.copy_(torch.from_numpy(means.mean(axis=0, dtype=np.float64)))
        self.covariance_root.copy_(torch.from_numpy(axes * np.sqrt(np.maximum(values, 0.0))))

    def fit_posterior(self, encoded: Iterable[tuple[Tensor, Tensor]]) -> None:
        """Fit the Gaussian to encoded batches, as `encode` returns them."""
        codes = [
            torch.stack([mean, log_variance.exp()]).detach().float().cpu().numpy() for mean, log_variance in encoded
        ]
        self.set_gaussian(*np.concatenate(codes, axis=1))

    def sample_points(self, count: int, rng: np.random.Generator, temperature: float) -> LatentPoints:
        """Draw points of the Gaussian, float32 (count, latent).

        The aggregate posterior differs from the prior, whose points decode to crude shapes. temperature: factor of the
        standard deviation.
        """
        noise = temperature * rng.standard_normal((count, len(self.center)))
        points: LatentPoints = (self.center.cpu().numpy() + noise @ self.covariance_root.cpu().numpy().T).astype(
            np.float32
        )
        return points


def reparameterize(mean: Tensor, log_variance: Tensor, noise: Generator) -> tuple[Tensor, Tensor]:
    """Draw a point of each posterior, float (n, latent); and their mean divergence from the prior, in nats."""
    points = mean + torch.exp(0.5 * log_variance) * torch.randn(mean.shape, generator=noise, device=mean.device)
    return points, 0.5 * (mean**2 + log_variance.exp() - 1.0 - log_variance).sum() / len(mean)
