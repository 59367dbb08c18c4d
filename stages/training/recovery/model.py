"""The network: an encoder of clouds or of drawings, and a decoder for each parameter (geocode §3.3)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import torch
from torch import Generator, Tensor, nn
from torch.nn.functional import leaky_relu, max_pool2d
from torch.nn.utils import convert_conv2d_weight_memory_format

from stages.programs.parameters import Parameter
from stages.training.recovery.drawings import DRAWING_SIDE_PIXELS
from stages.training.recovery.neighbors import edge_maximum, nearest_neighbors
from stages.training.recovery.outputs import regressed
from stages.training.recovery.settings import RecoveryModelConfig

LEAKY_SLOPE = 0.2


class RecoveryNet(nn.Module):
    """Inputs to outputs float (n, parameters, most classes), as `ParameterOutputs` reads them.

    A classified parameter has the logits of its classes, the hidden one last. Outputs beyond the classes of a parameter
    are minus infinity. With `separate_regression`, regressed parameters have an encoder of their own (Huang et al.
    2017).
    """

    continuous: Tensor

    def __init__(self, entry: RecoveryModelConfig, parameters: Sequence[Parameter]) -> None:
        super().__init__()
        encoder = Dgcnn if entry.input == "points" else Vgg
        self.encoder: nn.Module = encoder(entry)
        self.other: nn.Module | None = encoder(entry) if entry.prediction == "separate_regression" else None
        classes = [parameter.classes for parameter in parameters]
        self.decoders = Decoders(classes, 2 * entry.embedding, entry.decoder, entry.dropout)
        self.register_buffer("continuous", torch.tensor(regressed(entry, parameters)), persistent=False)

    def forward(self, inputs: Tensor, noise: Generator | None = None) -> Tensor:
        """Outputs for normalized clouds float (n, points, 3), or drawings float (n, 1, side, side), ink 1 on 0.

        noise: draws the dropout; None: no dropout
        """
        embeddings = self.encoder(inputs)[None]
        if self.other is not None:
            embeddings = torch.where(self.continuous[:, None, None], self.other(inputs), embeddings)
        outputs: Tensor = self.decoders(embeddings, noise)
        return outputs


class Dgcnn(nn.Module):
    """Clouds float (n, points, 3) to embeddings (n, 2 embedding).

    Edge convolutions over the neighbours in space; their features are concatenated and pooled over the points, by
    maximum and by mean. The published network rebuilds the graph from the features before each convolution.
    """

    def __init__(self, entry: RecoveryModelConfig) -> None:
        super().__init__()
        self.neighbors = entry.neighbors
        widths = pairwise((3, *entry.widths))
        self.convolutions = nn.ModuleList(EdgeConvolution(before, after) for before, after in widths)
        self.mixed = nn.Linear(sum(entry.widths), entry.embedding, bias=False)
        self.norm = nn.BatchNorm1d(entry.embedding)

    def forward(self, points: Tensor) -> Tensor:
        neighbors = nearest_neighbors(points, min(self.neighbors, points.shape[1]))
        first, *others = self.convolutions
        # bfloat16 would move points by up to a thousandth of the box, much of the distance to the next point
        with torch.autocast(points.device.type, enabled=False):
            features = first(points, neighbors)
        layers = [features]
        for convolution in others:
            features = convolution(features, neighbors)
            layers.append(features)
        mixed = leaky_relu(batch_normed(self.norm, self.mixed(torch.cat(layers, dim=-1))), LEAKY_SLOPE)
        return torch.cat([mixed.amax(dim=1), mixed.mean(dim=1)], dim=-1)


class EdgeConvolution(nn.Module):
    """The maximum over the neighbours j of `W1 x_i + W2 (x_j - x_i)`, normed.

    The linear part depends on single points, so it is computed once for each: the first half of `linear` is W1 - W2,
    the second W2.
    """

    def __init__(self, before: int, after: int) -> None:
        super().__init__()
        self.linear = nn.Linear(before, 2 * after, bias=False)
        self.norm = nn.BatchNorm1d(after)

    def forward(self, features: Tensor, neighbors: Tensor) -> Tensor:
        return leaky_relu(batch_normed(self.norm, edge_maximum(self.linear(features), neighbors)), LEAKY_SLOPE)


class Vgg(nn.Module):
    """Drawings float (n, 1, side, side) to embeddings (n, 2 embedding).

    A VGG with few features, whose first convolution reads patches, each pixel a feature. The published network begins
    with single pixels. With few features that takes nearly all of the time, although a few pixels tell a line: at equal
    time this one learns more.
    """

    PATCH_PIXELS = 4

    def __init__(self, entry: RecoveryModelConfig) -> None:
        super().__init__()
        layers: list[nn.Module] = [nn.PixelUnshuffle(self.PATCH_PIXELS)]
        for index, (before, after) in enumerate(pairwise((self.PATCH_PIXELS**2, *entry.channels))):
            layers += [nn.Conv2d(before, after, 3, padding=1, bias=False), nn.BatchNorm2d(after), nn.ReLU()]
            if index % 2:
                layers.append(HalveResolution())
        # twice as fast with so few features
        self.layers = convert_conv2d_weight_memory_format(nn.Sequential(*layers), torch.channels_last)
        side = DRAWING_SIDE_PIXELS // self.PATCH_PIXELS // 2 ** (len(entry.channels) // 2)
        self.embedding = nn.Linear(entry.channels[-1] * side * side, 2 * entry.embedding)

    def forward(self, drawings: Tensor) -> Tensor:
        features = self.layers(drawings.contiguous(memory_format=torch.channels_last))
        embedded: Tensor = self.embedding(features.flatten(1)).relu()
        return embedded


class HalveResolution(nn.Module):
    """Max pooling of 2 by 2 pixels, (n, features, h, w) to (n, features, h / 2, w / 2) rounded down."""

    def forward(self, features: Tensor) -> Tensor:
        if features.device.type == "cpu":
            return max_pool2d(features, 2)
        return halve_resolution(features)


def halve_resolution(features: Tensor) -> Tensor:
    """Max pooling for a GPU, where the gradient of `max_pool2d` depends on the order of its sums."""
    even = features[..., : features.shape[-2] // 2 * 2, : features.shape[-1] // 2 * 2]
    rows = torch.maximum(even[..., ::2, :], even[..., 1::2, :])
    return torch.maximum(rows[..., ::2], rows[..., 1::2])


class Decoders(nn.Module):
    """A perceptron of three layers for each parameter, all computed at once.

    Embeddings (1 or parameters, n, before) to outputs (n, parameters, most classes).
    """

    exists: Tensor

    def __init__(self, classes: Sequence[int], before: int, sizes: tuple[int, int], dropout: float) -> None:
        super().__init__()
        self.dropout = dropout
        widths = (before, *sizes, max(classes))
        self.weights = nn.ParameterList(_uniform(len(classes), a, b, a) for a, b in pairwise(widths))
        self.biases = nn.ParameterList(_uniform(len(classes), 1, b, a) for a, b in pairwise(widths))
        exists = torch.arange(max(classes)) < torch.tensor(classes)[:, None]
        self.register_buffer("exists", exists, persistent=False)

    def forward(self, embeddings: Tensor, noise: Generator | None) -> Tensor:
        features = embeddings.expand(len(self.weights[0]), *embeddings.shape[1:])
        last = len(self.weights) - 1
        for layer, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            features = torch.baddbmm(bias, features, weight)
            if layer < last:
                features = leaky_relu(features, LEAKY_SLOPE)
                if noise is not None and self.dropout:
                    kept = torch.rand(features.shape, generator=noise, device=features.device) >= self.dropout
                    features = features * kept / (1.0 - self.dropout)
        logits = features.transpose(0, 1).float()
        return logits.masked_fill(~self.exists, -torch.inf)


def _uniform(parameters: int, before: int, after: int, inputs: int) -> nn.Parameter:
    """Initial weights as those of torch's linear layers."""
    bound = 1.0 / math.sqrt(inputs)
    return nn.Parameter(torch.empty(parameters, before, after).uniform_(-bound, bound))


def batch_normed(norm: nn.Module, features: Tensor) -> Tensor:
    """Apply `norm` to features (clouds, n, width), over clouds and points together."""
    normed: Tensor = norm(features.flatten(0, 1)).view(features.shape)
    return normed
