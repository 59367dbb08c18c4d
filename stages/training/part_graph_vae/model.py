"""A VAE of part graphs that processes all nodes of a level at once (StructureNet §4).

The encoder goes from the cuboids up to the root: parts exchange messages with those that they touch, and a node is the
maximum over its parts. The decoder goes down: a node predicts which of MAX_CHILDREN parts exist and which of them
touch; after messages between these, their boxes, whether they have parts, and their codes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn.functional import leaky_relu

from stages.training.box_vectors import BOX_WIDTH
from stages.training.latent import LatentGaussian
from stages.training.part_graph_vae.batches import MAX_CHILDREN, GraphLevel
from stages.training.part_graph_vae.settings import PartGraphVaeConfig


@dataclass(frozen=True)
class DecodedParts:
    """The predicted parts of n nodes.

    exists, inner: float (n, MAX_CHILDREN), logits.
    touching: float (n, MAX_CHILDREN, MAX_CHILDREN), symmetric logits.
    boxes: float (n, MAX_CHILDREN, 9).
    codes: float (n, MAX_CHILDREN, hidden), of the parts as nodes.
    """

    exists: Tensor
    inner: Tensor
    touching: Tensor
    boxes: Tensor
    codes: Tensor


class PartGraphVae(LatentGaussian):
    """A VAE of part graphs."""

    def __init__(self, config: PartGraphVaeConfig) -> None:
        super().__init__(config.latent)
        hidden = config.hidden
        self.read_box = nn.Sequential(nn.Linear(BOX_WIDTH, hidden), nn.LeakyReLU(0.2), nn.Linear(hidden, hidden))
        self.read_node = nn.Linear(hidden, hidden)
        self.encoder_messages = MessagePassing(hidden, config.message_rounds)
        self.mean = nn.Linear(hidden, config.latent)
        self.log_variance = nn.Linear(hidden, config.latent)
        self.root = nn.Linear(config.latent, hidden)
        self.parts = nn.Sequential(
            nn.Linear(hidden, hidden), nn.LeakyReLU(0.2), nn.Linear(hidden, MAX_CHILDREN * hidden)
        )
        self.exists = nn.Linear(hidden, 1)
        self.edges = nn.Linear(hidden, hidden)
        self.decoder_messages = MessagePassing(hidden, config.message_rounds)
        self.boxes = nn.Sequential(nn.Linear(hidden, hidden), nn.LeakyReLU(0.2), nn.Linear(hidden, BOX_WIDTH + 1))
        self.below = nn.Sequential(nn.Linear(hidden, hidden), nn.LeakyReLU(0.2), nn.Linear(hidden, hidden))

    def encode(self, batch: Sequence[GraphLevel]) -> tuple[Tensor, Tensor]:
        """Return mean and logarithm of the variance, float (shapes, latent) each."""
        codes: Tensor | None = None
        for level in reversed(batch):
            features: Tensor = self.read_box(level.boxes)
            if codes is not None:
                flat = features.flatten(0, 1).index_put((level.opened,), self.read_node(codes), accumulate=True)
                features = flat.view_as(features)
            mixed = self.encoder_messages(features, level.touching)
            codes = mixed.masked_fill(level.part_mask[..., None] == 0, -torch.inf).amax(dim=1)
        assert codes is not None
        return self.mean(codes), self.log_variance(codes)

    def decode(self, codes: Tensor) -> DecodedParts:
        """Predict the parts of nodes with codes (n, hidden). The code of a root is `root` of a latent point."""
        features: Tensor = leaky_relu(self.parts(codes), 0.2).view(len(codes), MAX_CHILDREN, codes.shape[1])
        exists = self.exists(features)[..., 0]
        ends = self.edges(features)
        touching = ends @ ends.transpose(1, 2) / ends.shape[-1] ** 0.5
        probability = torch.sigmoid(exists)
        weights = torch.sigmoid(touching) * probability[:, :, None] * probability[:, None]
        mixed = self.decoder_messages(features, weights)
        boxes, inner = self.boxes(mixed).split([BOX_WIDTH, 1], dim=-1)
        return DecodedParts(exists, inner[..., 0], touching, boxes, self.below(mixed))


class MessagePassing(nn.Module):
    """Rounds of messages between touching parts."""

    def __init__(self, hidden: int, rounds: int) -> None:
        super().__init__()
        self.rounds = nn.ModuleList(nn.Linear(2 * hidden, hidden) for _ in range(rounds))
        self.joined = nn.Linear((rounds + 1) * hidden, hidden)

    def forward(self, features: Tensor, touching: Tensor) -> Tensor:
        """Return the features of parts after all rounds, float (n, k, hidden).

        touching: float (n, k, k), the probability of each edge.
        """
        shares = touching / touching.sum(dim=-1, keepdim=True).clamp(min=1.0)
        states = [features]
        for layer in self.rounds:
            states.append(leaky_relu(layer(torch.cat([states[-1], shares @ states[-1]], dim=-1)), 0.2))
        outputs: Tensor = self.joined(torch.cat(states, dim=-1))
        return outputs
