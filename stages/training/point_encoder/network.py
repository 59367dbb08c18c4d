"""A small network that embeds points so that points of one part lie close together."""

from __future__ import annotations

from itertools import pairwise

import torch
from torch import Tensor, nn
from torch.nn.functional import binary_cross_entropy_with_logits, leaky_relu, normalize

from stages.training.recovery.model import LEAKY_SLOPE, EdgeConvolution, batch_normed
from stages.training.recovery.neighbors import edge_maximum, nearest_neighbors

OFFSET_WIDTH = 32
"""Features of the offsets to the neighbours, and as many of the positions."""
WIDTHS = (2 * OFFSET_WIDTH, 64, 64, 128)
"""Features of each point after the first layer and after each edge convolution."""
CONTEXT_WIDTH = 128
"""Features of the whole cloud."""
HIDDEN_WIDTH = 128
EMBEDDING_WIDTH = 32
NEIGHBORS_PER_POINT = 16
MAX_PAIR_DISTANCE = 0.15
"""Largest distance of a near pair, in diagonals of the bounding box."""
INITIAL_THRESHOLD = 0.6
"""Squared distance of two embeddings at which "same part" is as likely as not."""
INITIAL_LOG_SHARPNESS = 1.5
"""Logarithm of the change of the logit with the squared distance."""


class PointEncoder(nn.Module):
    """Clouds float (n, points, 3) of diagonal 1 to unit embeddings float (n, points, EMBEDDING_WIDTH).

    Edge convolutions over the neighbours in space; the maximum of their features over the cloud is the context of each
    point. 128,738 weights.
    """

    def __init__(self) -> None:
        super().__init__()
        self.offsets = OffsetConvolution(OFFSET_WIDTH)
        self.convolutions = nn.ModuleList(EdgeConvolution(before, after) for before, after in pairwise(WIDTHS))
        self.context = nn.Linear(WIDTHS[-1], CONTEXT_WIDTH)
        self.context_norm = nn.BatchNorm1d(CONTEXT_WIDTH)
        self.local = nn.Linear(sum(WIDTHS), HIDDEN_WIDTH)
        self.whole = nn.Linear(CONTEXT_WIDTH, HIDDEN_WIDTH, bias=False)
        self.hidden = nn.Linear(HIDDEN_WIDTH, HIDDEN_WIDTH)
        self.hidden_norm = nn.BatchNorm1d(HIDDEN_WIDTH)
        self.embedding = nn.Linear(HIDDEN_WIDTH, EMBEDDING_WIDTH)
        self.threshold = nn.Parameter(torch.tensor(INITIAL_THRESHOLD))
        self.log_sharpness = nn.Parameter(torch.tensor(INITIAL_LOG_SHARPNESS))

    def forward(self, points: Tensor, chosen: Tensor | None = None) -> Tensor:
        """Embed the points, or only those with the indices `chosen` int (m,): float (n, m, EMBEDDING_WIDTH)."""
        neighbors = nearest_neighbors(points, min(NEIGHBORS_PER_POINT, points.shape[1]))
        layers = [self.offsets(points, neighbors)]
        for convolution in self.convolutions:
            layers.append(convolution(layers[-1], neighbors))
        context = leaky_relu(batch_normed(self.context_norm, self.context(layers[-1])), LEAKY_SLOPE)
        whole = self.whole(context.amax(dim=1, keepdim=True))
        joined = torch.cat(layers if chosen is None else [layer[:, chosen] for layer in layers], dim=-1)
        mixed = leaky_relu(self.local(joined) + whole, LEAKY_SLOPE)
        hidden = leaky_relu(batch_normed(self.hidden_norm, self.hidden(mixed)), LEAKY_SLOPE)
        return normalize(self.embedding(hidden), dim=-1)


class OffsetConvolution(nn.Module):
    """The maximum over the neighbours j of `W1 (x_j - x_i)`, followed by `W2 x_i`; each is normed separately.

    Offsets are some thirty times shorter than positions. In one sum, normed together, they nearly vanish.
    """

    def __init__(self, width: int) -> None:
        super().__init__()
        self.of_offsets = nn.Linear(3, width, bias=False)
        self.offset_norm = nn.BatchNorm1d(width)
        self.of_positions = nn.Linear(3, width, bias=False)
        self.position_norm = nn.BatchNorm1d(width)

    def forward(self, points: Tensor, neighbors: Tensor) -> Tensor:
        projected = self.of_offsets(points)
        offsets = edge_maximum(torch.cat([-projected, projected], dim=-1), neighbors)
        normed = batch_normed(self.offset_norm, offsets), batch_normed(self.position_norm, self.of_positions(points))
        return leaky_relu(torch.cat(normed, dim=-1), LEAKY_SLOPE)


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
    embeddings = encoder(points, chosen)
    near = near_point_pairs(points[:, chosen])
    logits = encoder.log_sharpness.exp() * (encoder.threshold - squared_distances(embeddings)[near])
    parts = parts[:, chosen]
    same = (parts[:, :, None] == parts[:, None, :])[near]
    return binary_cross_entropy_with_logits(logits, same.float())
