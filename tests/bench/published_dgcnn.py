"""The network of the geocode paper for clouds, in plain torch, as a peer of ours (§3.3)."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import torch
from torch import Tensor, nn
from torch.nn.functional import cross_entropy


class PublishedDGCNN(nn.Module):
    """DGCNN: k 20, widths 16, 16, 32, 64, embedding 64; a perceptron 128-128-64-n per parameter, dropout 0.5.

    Before each convolution, a new graph is made from all distances, with every edge in memory.
    """

    def __init__(self, classes: Sequence[int]) -> None:
        super().__init__()
        widths = (3, 16, 16, 32, 64)
        self.edges = nn.ModuleList(
            nn.Sequential(nn.Conv2d(2 * a, b, 1, bias=False), nn.BatchNorm2d(b), nn.LeakyReLU(0.2))
            for a, b in pairwise(widths)
        )
        self.mixed = nn.Sequential(nn.Conv1d(128, 64, 1, bias=False), nn.BatchNorm1d(64), nn.LeakyReLU(0.2))
        self.decoders = nn.ModuleList(
            nn.Sequential(
                nn.Linear(128, 128), nn.ReLU(), nn.Dropout(0.5),
                nn.Linear(128, 64), nn.ReLU(), nn.Dropout(0.5), nn.Linear(64, count),
            )
            for count in classes
        )  # fmt: skip

    def forward(self, clouds: Tensor) -> list[Tensor]:
        """Of clouds (n, points, 3), logits (n, classes) of each parameter."""
        features, found = clouds.transpose(1, 2), []
        for convolution in self.edges:
            inner = 2.0 * features.transpose(1, 2) @ features
            squares = (features**2).sum(dim=1)
            nearest = (inner - squares[:, :, None] - squares[:, None, :]).topk(20, dim=-1).indices
            batch = torch.arange(len(features))[:, None, None]
            others = features.transpose(1, 2)[batch, nearest]
            own = features.transpose(1, 2)[:, :, None].expand_as(others)
            edges = torch.cat([others - own, own], dim=-1).permute(0, 3, 1, 2)
            features = convolution(edges).amax(dim=-1)
            found.append(features)
        mixed = self.mixed(torch.cat(found, dim=1))
        embedded = torch.cat([mixed.amax(dim=-1), mixed.mean(dim=-1)], dim=1)
        return [decoder(embedded) for decoder in self.decoders]

    def loss(self, clouds: Tensor, classes: Tensor) -> Tensor:
        """Cross-entropies, summed over the parameters; classes int64 (n, parameters)."""
        logits = self.forward(clouds)
        return torch.stack([cross_entropy(a, b) for a, b in zip(logits, classes.T, strict=True)]).sum()
