"""The hierarchical sequence VAE of ShapeAssembly programs (shapeassembly §6.1), over the nodes of a level at once.

An assembly is read by a GRU, line by line; a line that declares an expanded cuboid brings the code of the assembly that
expands it, so that the encoder climbs from the leaves to the root. The decoder goes down again: a GRU that begins with
the code of an assembly writes its lines, and the code of each assembly below it.
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
    """Programs to points of a latent space, and back to what a line decoder says of each line."""

    def __init__(self, entry: ProgramVaeConfig) -> None:
        super().__init__(entry.latent)
        hidden, latent = entry.hidden, entry.latent
        self.read_line = nn.Linear(LINE_WIDTH + 3, hidden)
        self.read_child = nn.Linear(hidden, hidden)
        self.reader = nn.GRU(hidden, hidden, batch_first=True)
        self.mean = nn.Linear(hidden, latent)
        self.log_variance = nn.Linear(hidden, latent)
        self.root_box = _layers(latent, hidden, 3)
        self.first = nn.Linear(latent, hidden)
        self.writer = nn.GRU(LINE_WIDTH, hidden, batch_first=True)
        self.lines = LineDecoder(hidden, latent)

    def encode(self, levels: Sequence[AssemblyLevel]) -> tuple[Tensor, Tensor]:
        """Mean and logarithm of the variance, float (programs, latent) each."""
        codes: Tensor | None = None
        for depth in reversed(range(len(levels))):
            level = levels[depth]
            boxes = level.boxes[:, None].expand(-1, level.lines.shape[1], -1)
            seen = self.read_line(torch.cat([level.lines, boxes], dim=-1))
            if codes is not None:
                below = levels[depth + 1].parents
                children = self.read_child(codes)
                seen = seen.index_put((below[:, 0], below[:, 1]), children, accumulate=True)
            read, _ = self.reader(seen)
            codes = read[torch.arange(len(read), device=read.device), level.lengths - 1]
        assert codes is not None
        return self.mean(codes), self.log_variance(codes)

    def start(self, codes: Tensor) -> Tensor:
        """The state, float (1, n, hidden), before the first line of nodes with these codes, float (n, latent)."""
        return torch.tanh(self.first(codes))[None]

    def write(self, shown: Tensor, state: Tensor) -> tuple[Tensor, Tensor]:
        """States float (n, lines, hidden) in which lines are written after the lines `shown`, (n, lines, 63), and the
        last, (1, n, hidden)."""
        states, last = self.writer(shown, state)
        return states, last


class LineDecoder(nn.Module):
    """What a state says of its line: each part by layers of its own, which see what is known of the line already."""

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
        """Logits (q, 7), from states (q, hidden) and the sizes of the bounding boxes (q, 3)."""
        found: Tensor = self._command(torch.cat([states, boxes], dim=-1))
        return found

    def cuboid(self, states: Tensor, boxes: Tensor) -> tuple[Tensor, Tensor]:
        """Sizes (q, 3) and the logit (q,) of being aligned."""
        found = self._cuboid(torch.cat([states, boxes], dim=-1))
        return found[:, :3], found[:, 3]

    def indices(self, states: Tensor, commands: Tensor) -> Tensor:
        """Logits (q, 3, 11) of the cuboids in lines of these commands, one-hot (q, 7)."""
        found: Tensor = self._indices(torch.cat([states, commands], dim=-1)).view(-1, 3, SLOT_COUNT)
        return found

    def attach(self, states: Tensor, slots: Tensor, sizes: Tensor) -> Tensor:
        """Both points (q, 6) of cuboids, one-hot (q, 2, 11), with sizes (q, 2, 3)."""
        found: Tensor = self._attach(torch.cat([states, slots.flatten(1), sizes.flatten(1)], dim=-1))
        return found

    def squeeze(self, states: Tensor, slots: Tensor, sizes: Tensor) -> tuple[Tensor, Tensor]:
        """Logits (q, 6) of the faces and the place (q, 2) on one, of cuboids (q, 3, 11) with sizes (q, 3, 3)."""
        found = self._squeeze(torch.cat([states, slots.flatten(1), sizes.flatten(1)], dim=-1))
        return found[:, :6], found[:, 6:]

    def symmetry(self, states: Tensor, slots: Tensor, sizes: Tensor, boxes: Tensor) -> tuple[Tensor, Tensor]:
        """Logits (q, 3) of the axes, and copies and distance (q, 2), of cuboids (q, 11) with sizes (q, 3)."""
        found = self._symmetry(torch.cat([states, slots, sizes, boxes], dim=-1))
        return found[:, :3], found[:, 3:]

    def child(self, states: Tensor, sizes: Tensor, codes: Tensor) -> tuple[Tensor, Tensor]:
        """Logits (q,) of being expanded and the codes (q, latent) of what expands cuboids of these sizes (q, 3), in
        nodes of these codes (q, latent)."""
        found = self._child(torch.cat([states, sizes, codes], dim=-1))
        return found[:, 0], found[:, 1:]


def sizes_of(slots: Tensor, sizes: Tensor) -> Tensor:
    """The sizes (q, k, 3) of cuboids, one-hot (q, k, 11), of nodes whose cuboids have `sizes` (q, 11, 3)."""
    return slots @ sizes


def _layers(inputs: int, hidden: int, outputs: int) -> nn.Sequential:
    """Three layers (shapeassembly §6.2)."""
    slope = 0.2
    return nn.Sequential(
        nn.Linear(inputs, hidden), nn.LeakyReLU(slope), nn.Linear(hidden, hidden), nn.LeakyReLU(slope),
        nn.Linear(hidden, outputs),
    )  # fmt: skip
