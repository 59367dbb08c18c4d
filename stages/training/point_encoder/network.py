"""A small network that embeds points so that points of one part lie close together."""

from __future__ import annotations

from itertools import pairwise

import torch
from torch import Tensor, nn
from torch.nn.functional import binary_cross_entropy_with_logits, leaky_relu, normalize

from stages.training.point_encoder.local_surface import FEATURES_PER_COUNT, NEIGHBOR_COUNTS, local_surface
from stages.training.recovery.model import LEAKY_SLOPE, EdgeConvolution, batch_normed
from stages.training.recovery.neighbors import edge_maximum, nearest_neighbors

OFFSET_WIDTH = 32
"""Features of the offsets to the neighbours, as many of the positions, and as many of the local surface."""
WIDTHS = (64, 64, 64, 128)
"""Features of each point after the first layer and after each edge convolution."""
CONTEXT_WIDTH = 128
"""Features of the whole cloud."""
HIDDEN_WIDTH = 128
EMBEDDING_WIDTH = 32
NEIGHBORS_PER_POINT = 16
DILATIONS = (1, 2, 4)
"""Each edge convolution looks at every n-th of the nearest points: the later, the farther."""
NEAREST_POINTS = max(*NEIGHBOR_COUNTS, NEIGHBORS_PER_POINT * DILATIONS[-1])
MAX_PAIR_DISTANCE = 0.15
"""Largest distance of a near pair, in diagonals of the bounding box."""
INITIAL_THRESHOLD = 0.6
"""Squared distance of two embeddings at which "same part" is as likely as not."""
INITIAL_LOG_SHARPNESS = 1.5
"""Logarithm of the change of the logit with the squared distance."""


class PointEncoder(nn.Module):
    """Clouds float (n, points, 3) of diagonal 1 to unit embeddings float (n, points, EMBEDDING_WIDTH).

    Edge convolutions over the neighbours in space, near ones first, then farther ones. They begin with the position of
    each point, the offsets to its neighbours and the surface around it. The maximum of their features over the cloud is
    the context of each point. 135,874 weights.
    """

    def __init__(self) -> None:
        super().__init__()
        self.offsets = OffsetConvolution(OFFSET_WIDTH)
        self.surface = nn.Linear(len(NEIGHBOR_COUNTS) * FEATURES_PER_COUNT, OFFSET_WIDTH, bias=False)
        self.surface_norm = nn.BatchNorm1d(OFFSET_WIDTH)
        self.first = nn.Linear(3 * OFFSET_WIDTH, WIDTHS[0])
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
        layers = self._layers(points)
        whole = self.whole(self._context(layers[-1])[:, None])
        joined = torch.cat(layers if chosen is None else [layer[:, chosen] for layer in layers], dim=-1)
        mixed = leaky_relu(self.local(joined) + whole, LEAKY_SLOPE)
        hidden = leaky_relu(batch_normed(self.hidden_norm, self.hidden(mixed)), LEAKY_SLOPE)
        return normalize(self.embedding(hidden), dim=-1)

    def describe(self, points: Tensor) -> Tensor:
        """Describe each cloud as a whole: float (n, CONTEXT_WIDTH)."""
        return self._context(self._layers(points)[-1])

    def _layers(self, points: Tensor) -> list[Tensor]:
        """Return the features of each point after the first layer and after each edge convolution."""
        nearest = nearest_neighbors(points, min(NEAREST_POINTS, points.shape[1]))
        layers = [self._first_layer(points, nearest)]
        for convolution, dilation in zip(self.convolutions, DILATIONS, strict=True):
            layers.append(convolution(layers[-1], _dilated(nearest, dilation)))
        return layers

    def _context(self, features: Tensor) -> Tensor:
        return leaky_relu(batch_normed(self.context_norm, self.context(features)), LEAKY_SLOPE).amax(dim=1)

    def _first_layer(self, points: Tensor, nearest: Tensor) -> Tensor:
        surface = batch_normed(self.surface_norm, self.surface(local_surface(points, nearest)))
        offsets = self.offsets(points, _dilated(nearest, 1))
        layer: Tensor = self.first(torch.cat([offsets, leaky_relu(surface, LEAKY_SLOPE)], dim=-1))
        return layer


def _dilated(nearest: Tensor, dilation: int) -> Tensor:
    return nearest[..., : NEIGHBORS_PER_POINT * dilation : dilation].contiguous()


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
    """Return the cross entropy of "same part" over the near pairs of the chosen points: the mean of the clouds' means.

    points: float (n, k, 3); parts: int (n, k); chosen: indices of points, int (m,).
    """
    embeddings = encoder(points, chosen)
    near = near_point_pairs(points[:, chosen])
    logits = encoder.log_sharpness.exp() * (encoder.threshold - squared_distances(embeddings))
    parts = parts[:, chosen]
    same = (parts[:, :, None] == parts[:, None, :]).float()
    losses = binary_cross_entropy_with_logits(logits, same, reduction="none") * near
    of_clouds = losses.sum(dim=(1, 2)) / near.sum(dim=(1, 2)).clamp(min=1)
    return of_clouds.mean()
