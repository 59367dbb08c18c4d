"""Where a model's latent space holds what it has learnt: the Gaussian that new points are drawn from."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import numpy.typing as npt
import torch
from torch import Generator, Tensor, nn

LatentPoints = npt.NDArray[np.float32]
"""Points of the latent space, float32 (n, latent)."""


class LatentGaussian(nn.Module):
    """A module with a latent space, of which `centre` (latent,) and `spread` (latent, latent) say where samples stand:
    centre + spread @ noise; the prior as long as nothing has been learnt."""

    def __init__(self, latent: int) -> None:
        super().__init__()
        self.centre: Tensor
        self.spread: Tensor
        self.register_buffer("centre", torch.zeros(latent))
        self.register_buffer("spread", torch.eye(latent))

    def set_gaussian(self, means: LatentPoints, variances: LatentPoints) -> None:
        """Say where samples stand, which are encoded as these means and variances, float32 (n, latent) each: as the
        Gaussian with the mean and the covariance of all of them together."""
        if not (np.isfinite(means).all() and np.isfinite(variances).all()):
            return  # the training has run away, which whoever trains tells
        covariance = np.cov(means.T.astype(np.float64), bias=True).reshape(2 * [means.shape[1]])
        values, axes = np.linalg.eigh(covariance + np.diag(variances.mean(axis=0, dtype=np.float64)))
        self.centre.copy_(torch.from_numpy(means.mean(axis=0, dtype=np.float64)))
        self.spread.copy_(torch.from_numpy(axes * np.sqrt(np.maximum(values, 0.0))))

    def fit_posterior(self, encoded: Iterable[tuple[Tensor, Tensor]]) -> None:
        """`stand_at` of all batches of samples: means and logarithms of the variances, float (n, latent) each."""
        codes = [torch.stack([mean, spread.exp()]).detach().float().cpu().numpy() for mean, spread in encoded]
        self.set_gaussian(*np.concatenate(codes, axis=1))

    def points(self, count: int, rng: np.random.Generator, temperature: float) -> LatentPoints:
        """Random points, float32 (count, latent), of that Gaussian, which the prior is not quite: from the prior come
        crude shapes. temperature: how far from its centre they spread."""
        noise = temperature * rng.standard_normal((count, len(self.centre)))
        found: LatentPoints = (self.centre.cpu().numpy() + noise @ self.spread.cpu().numpy().T).astype(np.float32)
        return found


def reparameterize(mean: Tensor, log_variance: Tensor, noise: Generator) -> tuple[Tensor, Tensor]:
    """A point of each sample's Gaussian, float (n, latent), and the divergence of these from the prior, in nats, mean
    over the samples."""
    points = mean + torch.exp(0.5 * log_variance) * torch.randn(mean.shape, generator=noise, device=mean.device)
    return points, 0.5 * (mean**2 + log_variance.exp() - 1.0 - log_variance).sum() / len(mean)
