"""The hierarchical sequence VAE of ShapeAssembly programs, over all assemblies of a level at once (shapeassembly §6.1).

The encoder is a GRU that reads an assembly line by line, from the leaves up to the root; the line of an expanded cuboid
carries the code of the assembly that expands it. The decoder goes down: a GRU, initialised with the code of an
assembly, predicts its lines, and the codes of the assemblies below.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn

from stages.training.latent import LatentGaussian
from stages.training.program_vae.batches import AssemblyLevel
from stages.training.program_vae.lines import LINE_WIDTH, SLOT_COUNT
from stages.training.program_vae.settings import ProgramVaeConfig

COMMAND_COUNT = 7


class ProgramVae(LatentGaussian):
    """Programs to latent points, and latent points to the predictions of a line decoder."""

    def __init__(self, config: ProgramVaeConfig) -> None:
        super().__init__(config.latent)
        hidden, latent = config.hidden, config.latent
        self.read_line = nn.Linear(LINE_WIDTH + 3, hidden)
        self.read_child = nn.Linear(hidden, hidden)
        self.reader = nn.GRU(hidden, hidden, batch_first=True)
        self.mean = nn.Linear(hidden, latent)
        self.log_variance = nn.Linear(hidden, latent)
        self.root_box = _layers(latent, hidden, 3)
        self.first = nn.Linear(latent, hidden)
        self.writer = nn.GRU(LINE_WIDTH, hidden, batch_first=True)
        self.lines = LineDecoder(hidden, latent)

    def encode(self, batch: Sequence[AssemblyLevel]) -> tuple[Tensor, Tensor]:
        """Return mean and logarithm of the variance, float (programs, latent) each."""
        codes: Tensor | None = None
        for depth in reversed(range(len(batch))):
            level = batch[depth]
            boxes = level.boxes[:, None].expand(-1, level.lines.shape[1], -1)
            features = self.read_line(torch.cat([level.lines, boxes], dim=-1))
            if codes is not None:
                below = batch[depth + 1].parents
                children = self.read_child(codes)
                features = features.index_put((below[:, 0], below[:, 1]), children, accumulate=True)
            states, _ = self.reader(features)
            codes = states[torch.arange(len(states), device=states.device), level.lengths - 1]
        assert codes is not None
        return self.mean(codes), self.log_variance(codes)

    def start(self, codes: Tensor) -> Tensor:
        """Return the state before the first line, float (1, n, hidden), of codes float (n, latent)."""
        return torch.tanh(self.first(codes))[None]

    def decode(self, before: Tensor, state: Tensor) -> tuple[Tensor, Tensor]:
        """Return the state of each line, float (n, lines, hidden), and the last one, float (1, n, hidden).

        before: float (n, lines, 63), the line before each.
        """
        states, last = self.writer(before, state)
        return states, last


class LineDecoder(nn.Module):
    """Predictions of a line from its state; each part has layers of its own, which see the parts decided already."""

    def __init__(self, hidden: int, latent: int) -> None:
        super().__init__()
        self._command = _layers(hidden + 3, hidden, COMMAND_COUNT)
        self._cuboid = _layers(hidden + 3, hidden, 4)
        self._indices = _layers(hidden + COMMAND_COUNT, hidden, 3 * SLOT_COUNT)
        self._attach = _layers(hidden + 2 * (SLOT_COUNT + 3), hidden, 6)
        self._squeeze = _layers(hidden + 3 * (SLOT_COUNT + 3), hidden, 8)
        self._symmetry = _layers(hidden + SLOT_COUNT + 6, hidden, 5)
        self._child = _layers(hidden + 3 + latent, hidden, 1 + latent)

    def command(self, states: Tensor, boxes: Tensor) -> Tensor:
        """Return logits (q, 7), from states (q, hidden) and sizes of the bounding boxes (q, 3)."""
        logits: Tensor = self._command(torch.cat([states, boxes], dim=-1))
        return logits

    def cuboid(self, states: Tensor, boxes: Tensor) -> tuple[Tensor, Tensor]:
        """Return sizes (q, 3) and the logit (q,) of the aligned flag."""
        outputs = self._cuboid(torch.cat([states, boxes], dim=-1))
        return outputs[:, :3], outputs[:, 3]

    def indices(self, states: Tensor, commands: Tensor) -> Tensor:
        """Return logits (q, 3, 11) of the cuboids in lines of commands, one-hot (q, 7)."""
        logits: Tensor = self._indices(torch.cat([states, commands], dim=-1)).view(-1, 3, SLOT_COUNT)
        return logits

    def attach(self, states: Tensor, slots: Tensor, sizes: Tensor) -> Tensor:
        """Return both points (q, 6) of an attachment of cuboids, one-hot (q, 2, 11), with sizes (q, 2, 3)."""
        points: Tensor = self._attach(torch.cat([states, slots.flatten(1), sizes.flatten(1)], dim=-1))
        return points

    def squeeze(self, states: Tensor, slots: Tensor, sizes: Tensor) -> tuple[Tensor, Tensor]:
        """Return logits (q, 6) of the face, and u, v (q, 2), of cuboids (q, 3, 11) with sizes (q, 3, 3)."""
        outputs = self._squeeze(torch.cat([states, slots.flatten(1), sizes.flatten(1)], dim=-1))
        return outputs[:, :6], outputs[:, 6:]

    def symmetry(self, states: Tensor, slots: Tensor, sizes: Tensor, boxes: Tensor) -> tuple[Tensor, Tensor]:
        """Return logits (q, 3) of the axis, and copies and distance (q, 2), of cuboids (q, 11) with sizes (q, 3)."""
        outputs = self._symmetry(torch.cat([states, slots, sizes, boxes], dim=-1))
        return outputs[:, :3], outputs[:, 3:]

    def child(self, states: Tensor, sizes: Tensor, codes: Tensor) -> tuple[Tensor, Tensor]:
        """Return logits (q,) of the expansion of cuboids, and codes (q, latent) of what expands them.

        sizes: float (q, 3), of the cuboids.
        codes: float (q, latent), of their assemblies.
        """
        outputs = self._child(torch.cat([states, sizes, codes], dim=-1))
        return outputs[:, 0], outputs[:, 1:]


def sizes_of(slots: Tensor, sizes: Tensor) -> Tensor:
    """Return the sizes of cuboids, float (q, k, 3).

    slots: one-hot (q, k, 11).
    sizes: float (q, 11, 3), of all cuboids of their assemblies.
    """
    return slots @ sizes


def _layers(inputs: int, hidden: int, outputs: int) -> nn.Sequential:
    """Build a perceptron of three layers (shapeassembly §6.2)."""
    slope = 0.2
    return nn.Sequential(
        nn.Linear(inputs, hidden), nn.LeakyReLU(slope), nn.Linear(hidden, hidden), nn.LeakyReLU(slope),
        nn.Linear(hidden, outputs),
    )  # fmt: skip
