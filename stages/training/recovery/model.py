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

SLOPE = 0.2


class RecoveryNet(nn.Module):
    """Inputs to outputs float (n, parameters, most classes): of each parameter the logits of its classes, the hidden
    one the last, or what `Answers` says. Outputs beyond the classes of a parameter are minus infinity.

    With answers `apart` an encoder of its own sees for the parameters that are regressed: but for the step they share,
    two networks (Huang et al. 2017).
    """

    continuous: Tensor

    def __init__(self, entry: RecoveryModelConfig, parameters: Sequence[Parameter]) -> None:
        super().__init__()
        encoder = Dgcnn if entry.input == "points" else Vgg
        self.encoder: nn.Module = encoder(entry)
        self.other: nn.Module | None = encoder(entry) if entry.answers == "apart" else None
        classes = [each.classes for each in parameters]
        self.decoders = Decoders(classes, 2 * entry.embedding, entry.decoder, entry.dropout)
        self.register_buffer("continuous", torch.tensor(regressed(entry, parameters)), persistent=False)

    def forward(self, inputs: Tensor, noise: Generator | None = None) -> Tensor:
        """Of clouds float (n, points, 3), normalised, or drawings float (n, 1, SIDE, SIDE), ink 1 on 0; `noise` says
        what is dropped, and nothing is without."""
        embeddings = self.encoder(inputs)[None]
        if self.other is not None:
            embeddings = torch.where(self.continuous[:, None, None], self.other(inputs), embeddings)
        outputs: Tensor = self.decoders(embeddings, noise)
        return outputs


class Dgcnn(nn.Module):
    """Clouds float (n, points, 3) to embeddings (n, 2 embedding): edge convolutions over the neighbours in space, all
    their features together, and of these the greatest and the mean over the points.

    Published is a graph that is made anew of the features before each convolution.
    """

    def __init__(self, entry: RecoveryModelConfig) -> None:
        super().__init__()
        self.neighbors = entry.neighbors
        self.convolutions = nn.ModuleList(EdgeConvolution(a, b) for a, b in pairwise((3, *entry.widths)))
        self.mixed = nn.Linear(sum(entry.widths), entry.embedding, bias=False)
        self.norm = nn.BatchNorm1d(entry.embedding)

    def forward(self, points: Tensor) -> Tensor:
        neighbors = nearest_neighbors(points, min(self.neighbors, points.shape[1]))
        first, *others = self.convolutions
        # bfloat16 would move points by up to a thousandth of the box, a good part of the way to the next
        with torch.autocast(points.device.type, enabled=False):
            features = first(points, neighbors)
        found = [features]
        for convolution in others:
            features = convolution(features, neighbors)
            found.append(features)
        mixed = leaky_relu(_normed(self.norm, self.mixed(torch.cat(found, dim=-1))), SLOPE)
        return torch.cat([mixed.amax(dim=1), mixed.mean(dim=1)], dim=-1)


class EdgeConvolution(nn.Module):
    """The greatest over the neighbours j of `W1 x_i + W2 (x_j - x_i)`, normed.

    The linear part is the same for all that look at a point, so it is done once a point: the first half of `linear` is
    W1 - W2, the second W2.
    """

    def __init__(self, before: int, after: int) -> None:
        super().__init__()
        self.linear = nn.Linear(before, 2 * after, bias=False)
        self.norm = nn.BatchNorm1d(after)

    def forward(self, features: Tensor, neighbors: Tensor) -> Tensor:
        return leaky_relu(_normed(self.norm, edge_maximum(self.linear(features), neighbors)), SLOPE)


class Vgg(nn.Module):
    """Drawings float (n, 1, SIDE, SIDE) to embeddings (n, 2 embedding): a VGG with few features, whose first
    convolution reads squares of PATCH by PATCH pixels, each pixel a feature.

    Published are convolutions of single pixels from the start. With few features nearly all of the time goes there,
    for lines that no more than a few pixels tell: at equal time this learns more.
    """

    PATCH = 4

    def __init__(self, entry: RecoveryModelConfig) -> None:
        super().__init__()
        layers: list[nn.Module] = [nn.PixelUnshuffle(self.PATCH)]
        for place, (before, after) in enumerate(pairwise((self.PATCH**2, *entry.channels))):
            layers += [nn.Conv2d(before, after, 3, padding=1, bias=False), nn.BatchNorm2d(after), nn.ReLU()]
            if place % 2:
                layers.append(HalveResolution())
        # twice as fast with so few features
        self.layers = convert_conv2d_weight_memory_format(nn.Sequential(*layers), torch.channels_last)
        side = DRAWING_SIDE_PIXELS // self.PATCH // 2 ** (len(entry.channels) // 2)
        self.embedding = nn.Linear(entry.channels[-1] * side * side, 2 * entry.embedding)

    def forward(self, drawings: Tensor) -> Tensor:
        seen = self.layers(drawings.contiguous(memory_format=torch.channels_last))
        embedded: Tensor = self.embedding(seen.flatten(1)).relu()
        return embedded


class HalveResolution(nn.Module):
    """Of each four pixels the greatest, (n, features, h, w) to (n, features, h / 2, w / 2) rounded down."""

    def forward(self, features: Tensor) -> Tensor:
        if features.device.type == "cpu":
            return max_pool2d(features, 2)
        return halve_resolution(features)


def halve_resolution(features: Tensor) -> Tensor:
    """What `HalveResolution` says, for a GPU, where the gradient of `max_pool2d` is added up in any order."""
    even = features[..., : features.shape[-2] // 2 * 2, : features.shape[-1] // 2 * 2]
    rows = torch.maximum(even[..., ::2, :], even[..., 1::2, :])
    return torch.maximum(rows[..., ::2], rows[..., 1::2])


class Decoders(nn.Module):
    """One perceptron of three layers for each parameter, all of them at once: embeddings (1 or parameters, n, before)
    to outputs (n, parameters, most classes)."""

    there: Tensor

    def __init__(self, classes: Sequence[int], before: int, sizes: tuple[int, int], dropped: float) -> None:
        super().__init__()
        self.dropped = dropped
        widths = (before, *sizes, max(classes))
        self.weights = nn.ParameterList(_uniform(len(classes), a, b, a) for a, b in pairwise(widths))
        self.biases = nn.ParameterList(_uniform(len(classes), 1, b, a) for a, b in pairwise(widths))
        there = torch.arange(max(classes)) < torch.tensor(classes)[:, None]
        self.register_buffer("there", there, persistent=False)

    def forward(self, embeddings: Tensor, noise: Generator | None) -> Tensor:
        features = embeddings.expand(len(self.weights[0]), *embeddings.shape[1:])
        last = len(self.weights) - 1
        for place, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            features = torch.baddbmm(bias, features, weight)
            if place < last:
                features = leaky_relu(features, SLOPE)
                if noise is not None and self.dropped:
                    kept = torch.rand(features.shape, generator=noise, device=features.device) >= self.dropped
                    features = features * kept / (1.0 - self.dropped)
        logits = features.transpose(0, 1).float()
        return logits.masked_fill(~self.there, -torch.inf)


def _uniform(parameters: int, before: int, after: int, inputs: int) -> nn.Parameter:
    """As a linear layer of torch begins."""
    reach = 1.0 / math.sqrt(inputs)
    return nn.Parameter(torch.empty(parameters, before, after).uniform_(-reach, reach))


def _normed(norm: nn.Module, features: Tensor) -> Tensor:
    """`norm` over clouds and points together."""
    normed: Tensor = norm(features.flatten(0, 1)).view(features.shape)
    return normed
