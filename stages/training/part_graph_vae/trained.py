"""A trained VAE of part graphs."""

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
from stages.training.checkpoint import load_module
from stages.training.latent import LatentPoints
from stages.training.part_graph_vae.batches import GraphCorpus, batch_of
from stages.training.part_graph_vae.corpus import graph_nodes
from stages.training.part_graph_vae.model import PartGraphVae
from stages.training.part_graph_vae.settings import PartGraphVaeConfig
from stages.training.program_vae.partial_assembly import MAX_DEPTH

SHAPES_PER_BATCH = 256


@dataclass(frozen=True)
class TrainedPartGraphVae:
    """A VAE of part graphs with its header."""

    module: PartGraphVae
    header: Mapping[str, Any]

    @property
    def latent(self) -> int:
        """Dimensions of the latent space."""
        return int(self.header["settings"]["latent"])

    @torch.no_grad()
    def encode(self, shapes: Sequence[Execution]) -> LatentPoints:
        """Encode executed programs: posterior means, float32 (n, latent). Raises Rejected as `graph_nodes`."""
        graphs = GraphCorpus.of([graph_nodes(shape) for shape in shapes])
        means: LatentPoints = self.module.encode(batch_of(graphs, np.arange(len(graphs))))[0].numpy()
        return means

    def sample_points(self, count: int, rng: np.random.Generator, temperature: float = 1.0) -> LatentPoints:
        """Draw points of the aggregate posterior, as `LatentGaussian.sample_points`."""
        return self.module.sample_points(count, rng, temperature)

    def sample(
        self, count: int, rng: np.random.Generator, temperature: float = 1.0
    ) -> tuple[list[tuple[Box, ...]], int]:
        """Sample shapes, as cuboids. Returns the shapes and the number of attempts; empty shapes are attempts too.

        temperature: as in `LatentGaussian.sample_points`.
        Raises ValueError where nearly all shapes are empty.
        """
        shapes: list[tuple[Box, ...]] = []
        attempts = 0
        while len(shapes) < count:
            if attempts > 50 * (count + SHAPES_PER_BATCH):
                raise ValueError(f"{len(shapes)} of {attempts} shapes had a cuboid; train the model longer")
            for boxes in self.decode(self.sample_points(SHAPES_PER_BATCH, rng, temperature)):
                if len(shapes) < count:
                    attempts += 1
                    shapes += [boxes] if boxes else []
        return shapes, attempts

    @torch.no_grad()
    def decode(self, points: LatentPoints) -> list[tuple[Box, ...]]:
        """Decode latent points, float32 (n, latent), to cuboids."""
        codes = self.module.root(torch.from_numpy(points))
        boxes: list[list[Box]] = [[] for _ in points]
        shapes = list(range(len(points)))
        for depth in range(MAX_DEPTH):
            if not shapes:
                break
            parts = self.module.decode(codes)
            exists = (parts.exists > 0).numpy()
            # A node without parts, or below the last level, is a cuboid with the predicted box.
            inner = (parts.inner > 0).numpy() & exists & (depth + 1 < MAX_DEPTH)
            below = self._have_parts(parts.codes[torch.from_numpy(inner)])
            inner[inner] = below
            for row, part in np.argwhere(exists & ~inner).tolist():
                boxes[shapes[row]].append(box_from_vector(parts.boxes[row, part].double().numpy()))
            codes = parts.codes[torch.from_numpy(inner)]
            shapes = [shapes[row] for row in np.nonzero(inner)[0].tolist()]
        return [tuple(cuboids) for cuboids in boxes]

    def _have_parts(self, codes: torch.Tensor) -> np.ndarray:
        """Return which nodes of codes (n, hidden) have a part, bool (n,)."""
        flags: np.ndarray = (self.module.decode(codes).exists > 0).any(dim=1).numpy()
        return flags


def load_part_graph_vae(path: Path, expected: Mapping[str, Any] | None = None) -> TrainedPartGraphVae:
    """Read the model in a file of weights, as `load_module`. expected: such as `{"kit": "chair"}`."""
    kind = {"kind": "part_graph_vae", **(expected or {})}
    return TrainedPartGraphVae(*load_module(path, kind, PartGraphVaeConfig, lambda config, _: PartGraphVae(config)))
