"""A trained VAE of part graphs, read from its published weights alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from stages.shapeassembly.execution.interpreter import Execution
from stages.shapeassembly.extraction.hierarchy import Box
from stages.training.box_vectors import box_from_vector
from stages.training.checkpoint import CheckpointError, load_checkpoint
from stages.training.latent import LatentPoints
from stages.training.part_graph_vae.batches import GraphCorpus, batch_of
from stages.training.part_graph_vae.corpus import graph_nodes
from stages.training.part_graph_vae.model import PartGraphVae
from stages.training.part_graph_vae.settings import PartGraphVaeConfig
from stages.training.program_vae.partial_assembly import MAX_DEPTH

SHAPES_PER_BATCH = 256


@dataclass(frozen=True)
class TrainedPartGraphVae:
    """header: what the weights say of themselves."""

    module: PartGraphVae
    header: Mapping[str, Any]

    @property
    def latent(self) -> int:
        """Dimensions of the latent space."""
        return int(self.header["settings"]["latent"])

    @torch.no_grad()
    def encode(self, shapes: Sequence[Execution]) -> LatentPoints:
        """Encode executed programs: posterior means, float32 (n, latent). Raises Rejected as `graph_nodes`."""
        graphs = GraphCorpus.of([graph_nodes(each) for each in shapes])
        found: LatentPoints = self.module.encode(batch_of(graphs, np.arange(len(graphs))))[0].numpy()
        return found

    def points(self, count: int, rng: np.random.Generator, temperature: float = 1.0) -> LatentPoints:
        """Random points, float32 (count, latent), of where shapes stand, as `Standing.points`."""
        return self.module.points(count, rng, temperature)

    def sample(
        self, count: int, rng: np.random.Generator, temperature: float = 1.0
    ) -> tuple[list[tuple[Box, ...]], int]:
        """The cuboids of so many shapes, and how many were begun for them: those without one count too. temperature:
        as `Standing.points`. Raises ValueError where nearly all have none."""
        kept: list[tuple[Box, ...]] = []
        begun = 0
        while len(kept) < count:
            if begun > 50 * (count + SHAPES_PER_BATCH):
                raise ValueError(f"{len(kept)} of {begun} shapes had a cuboid; train the model longer")
            for each in self.decode(self.points(SHAPES_PER_BATCH, rng, temperature)):
                if len(kept) < count:
                    begun += 1
                    kept += [each] if each else []
        return kept, begun

    @torch.no_grad()
    def decode(self, points: LatentPoints) -> list[tuple[Box, ...]]:
        """The cuboids at each point of the latent space, float32 (n, latent)."""
        codes = self.module.root(torch.from_numpy(points))
        found: list[list[Box]] = [[] for _ in points]
        shapes = list(range(len(points)))
        for depth in range(MAX_DEPTH):
            if not shapes:
                break
            said = self.module.decode(codes)
            there = (said.there > 0).numpy()
            # A node without parts, and what is below the last level, is the cuboid that was said of it.
            inner = (said.inner > 0).numpy() & there & (depth + 1 < MAX_DEPTH)
            below = self._have_parts(said.codes[torch.from_numpy(inner)])
            inner[inner] = below
            for row, place in np.argwhere(there & ~inner).tolist():
                found[shapes[row]].append(box_from_vector(said.boxes[row, place].double().numpy()))
            codes = said.codes[torch.from_numpy(inner)]
            shapes = [shapes[row] for row in np.nonzero(inner)[0].tolist()]
        return [tuple(each) for each in found]

    def _have_parts(self, codes: torch.Tensor) -> np.ndarray:
        """Which nodes of codes (n, hidden) have a part, bool (n,)."""
        found: np.ndarray = (self.module.decode(codes).there > 0).any(dim=1).numpy()
        return found


def load_part_graph_vae(path: Path, expected: Mapping[str, Any] | None = None) -> TrainedPartGraphVae:
    """The model in a file of weights, on the CPU.

    Raises CheckpointError for whatever is not one, or says something else of itself than `expected`, such as
    `{"kit": "chair"}`.
    """
    tensors, header = load_checkpoint(path, {"kind": "part_graph_vae", **(expected or {})})
    module = PartGraphVae(
        PartGraphVaeConfig.model_validate({"name": "trained", "kind": "part_graph_vae", **header["settings"]})
    )
    if module.state_dict().keys() != tensors.keys():
        raise CheckpointError(f"{path} has other tensors than this version of Shapemill: train it again (make train)")
    module.load_state_dict(tensors)
    return TrainedPartGraphVae(module.eval(), header)
