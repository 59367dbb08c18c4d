"""A small network that embeds points so that points of one part lie close together."""

from __future__ import annotations

from itertools import pairwise

import torch
from torch import Tensor, nn
from torch.nn.functional import binary_cross_entropy_with_logits, leaky_relu

from stages.training.recovery.model import LEAKY_SLOPE, EdgeConvolution
from stages.training.recovery.neighbors import nearest_neighbors

WIDTHS = (64, 64, 128)
"""Features of the edge convolutions."""
CONTEXT_WIDTH = 256
"""Features of the whole cloud."""
HIDDEN_WIDTH = 128
EMBEDDING_WIDTH = 32
NEIGHBORS_PER_POINT = 16
MAX_PAIR_DISTANCE = 0.15
"""Largest distance of a near pair, in diagonals of the bounding box."""


class PointEncoder(nn.Module):
    """Clouds float (n, points, 3) of diagonal 1 to embeddings float (n, points, EMBEDDING_WIDTH).

    Edge convolutions over the neighbours in space; the maximum of their features over the cloud is the context of each
    point. 177,569 weights.
    """

    def __init__(self) -> None:
        super().__init__()
        self.convolutions = nn.ModuleList(EdgeConvolution(before, after) for before, after in pairwise((3, *WIDTHS)))
        self.context = nn.Linear(sum(WIDTHS), CONTEXT_WIDTH)
        self.local = nn.Linear(sum(WIDTHS), HIDDEN_WIDTH)
        self.whole = nn.Linear(CONTEXT_WIDTH, HIDDEN_WIDTH, bias=False)
        self.hidden = nn.Linear(HIDDEN_WIDTH, HIDDEN_WIDTH)
        self.embedding = nn.Linear(HIDDEN_WIDTH, EMBEDDING_WIDTH)
        self.threshold = nn.Parameter(torch.ones(()))

    def forward(self, points: Tensor) -> Tensor:
        neighbors = nearest_neighbors(points, min(NEIGHBORS_PER_POINT, points.shape[1]))
        layers = []
        features = points
        for convolution in self.convolutions:
            features = convolution(features, neighbors)
            layers.append(features)
        joined = torch.cat(layers, dim=-1)
        context = leaky_relu(self.context(joined), LEAKY_SLOPE).amax(dim=1, keepdim=True)
        mixed = leaky_relu(self.local(joined) + self.whole(context), LEAKY_SLOPE)
        embeddings: Tensor = self.embedding(leaky_relu(self.hidden(mixed), LEAKY_SLOPE))
        return embeddings


def squared_distances(vectors: Tensor) -> Tensor:
    """Return the squared distances of vectors float (n, k, d) among themselves, float (n, k, k)."""
    squares = (vectors * vectors).sum(dim=-1)
    distances: Tensor = squares[:, :, None] + squares[:, None, :] - 2.0 * vectors @ vectors.transpose(1, 2)
    return distances.clamp(min=0.0)


def near_point_pairs(points: Tensor) -> Tensor:
    """Return which pairs of points float (n, k, 3) are near, each pair once, bool (n, k, k)."""
    count = points.shape[1]
    once = torch.ones((count, count), dtype=torch.bool, device=points.device).triu(1)
    return (squared_distances(points) < MAX_PAIR_DISTANCE**2) & once


def same_part_loss(encoder: PointEncoder, points: Tensor, parts: Tensor, chosen: Tensor) -> Tensor:
    """Return the cross entropy of "same part" over the near pairs of the chosen points of clouds.

    points: float (n, k, 3); parts: int (n, k); chosen: indices of points, int (m,).
    """
    embeddings = encoder(points)[:, chosen]
    points, parts = points[:, chosen], parts[:, chosen]
    near = near_point_pairs(points)
    logits = encoder.threshold - squared_distances(embeddings)[near]
    same = (parts[:, :, None] == parts[:, None, :])[near]
    return binary_cross_entropy_with_logits(logits, same.float())
