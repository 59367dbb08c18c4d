"""Part graphs to points of a latent space and back, over the nodes of a level at once (StructureNet §4).

Encoding climbs from the cuboids to the root: the parts of a node hear of those that they touch, and the node is the
greatest of what is said of them. Decoding goes down again: a node says which of so many parts are there, which of them
touch, and, after these have heard of each other, their boxes, which of them have parts, and the code of each.
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
    """What is said of the parts of n nodes. there, inner: logits float (n, MOST_CHILDREN); touching: logits float (n,
    MOST_CHILDREN, MOST_CHILDREN), symmetric; boxes: float (n, MOST_CHILDREN, 9); codes: float (n, MOST_CHILDREN,
    hidden), of the parts as nodes."""

    there: Tensor
    inner: Tensor
    touching: Tensor
    boxes: Tensor
    codes: Tensor


class PartGraphVae(LatentGaussian):
    """A VAE of part graphs."""

    def __init__(self, entry: PartGraphVaeConfig) -> None:
        super().__init__(entry.latent)
        hidden = entry.hidden
        self.read_box = nn.Sequential(nn.Linear(BOX_WIDTH, hidden), nn.LeakyReLU(0.2), nn.Linear(hidden, hidden))
        self.read_node = nn.Linear(hidden, hidden)
        self.heard = MessagePassing(hidden, entry.message_rounds)
        self.mean = nn.Linear(hidden, entry.latent)
        self.log_variance = nn.Linear(hidden, entry.latent)
        self.root = nn.Linear(entry.latent, hidden)
        self.parts = nn.Sequential(
            nn.Linear(hidden, hidden), nn.LeakyReLU(0.2), nn.Linear(hidden, MAX_CHILDREN * hidden)
        )
        self.there = nn.Linear(hidden, 1)
        self.edges = nn.Linear(hidden, hidden)
        self.told = MessagePassing(hidden, entry.message_rounds)
        self.said = nn.Sequential(nn.Linear(hidden, hidden), nn.LeakyReLU(0.2), nn.Linear(hidden, BOX_WIDTH + 1))
        self.below = nn.Sequential(nn.Linear(hidden, hidden), nn.LeakyReLU(0.2), nn.Linear(hidden, hidden))

    def encode(self, levels: Sequence[GraphLevel]) -> tuple[Tensor, Tensor]:
        """Mean and logarithm of the variance, float (shapes, latent) each."""
        codes: Tensor | None = None
        for level in reversed(levels):
            seen: Tensor = self.read_box(level.boxes)
            if codes is not None:
                flat = seen.flatten(0, 1).index_put((level.opened,), self.read_node(codes), accumulate=True)
                seen = flat.view_as(seen)
            heard = self.heard(seen, level.touching)
            codes = heard.masked_fill(level.there[..., None] == 0, -torch.inf).amax(dim=1)
        assert codes is not None
        return self.mean(codes), self.log_variance(codes)

    def decode(self, codes: Tensor) -> DecodedParts:
        """What nodes of codes (n, hidden) say of their parts; those of roots are `root` of a point."""
        seen: Tensor = leaky_relu(self.parts(codes), 0.2).view(len(codes), MAX_CHILDREN, codes.shape[1])
        there = self.there(seen)[..., 0]
        ends = self.edges(seen)
        touching = ends @ ends.transpose(1, 2) / ends.shape[-1] ** 0.5
        sure = torch.sigmoid(there)
        told = self.told(seen, torch.sigmoid(touching) * sure[:, :, None] * sure[:, None])
        boxes, inner = self.said(told).split([BOX_WIDTH, 1], dim=-1)
        return DecodedParts(there, inner[..., 0], touching, boxes, self.below(told))


class MessagePassing(nn.Module):
    """Rounds in which parts hear of those that they touch."""

    def __init__(self, hidden: int, rounds: int) -> None:
        super().__init__()
        self.rounds = nn.ModuleList(nn.Linear(2 * hidden, hidden) for _ in range(rounds))
        self.joined = nn.Linear((rounds + 1) * hidden, hidden)

    def forward(self, seen: Tensor, touching: Tensor) -> Tensor:
        """What is said of parts, float (n, k, hidden), after all rounds, from what was, and how surely each touches
        each, float (n, k, k)."""
        shares = touching / touching.sum(dim=-1, keepdim=True).clamp(min=1.0)
        states = [seen]
        for each in self.rounds:
            states.append(leaky_relu(each(torch.cat([states[-1], shares @ states[-1]], dim=-1)), 0.2))
        found: Tensor = self.joined(torch.cat(states, dim=-1))
        return found
