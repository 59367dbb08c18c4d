"""A trained model of ShapeAssembly programs, read from its published weights alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from stages.shapeassembly.syntax.program import Program
from stages.training.checkpoint import CheckpointError, load_checkpoint
from stages.training.latent import Points
from stages.training.program_vae.batches import Programs, batch_of
from stages.training.program_vae.decoding import write_programs
from stages.training.program_vae.lines import node_lines
from stages.training.program_vae.model import ProgramVae
from stages.training.program_vae.settings import ProgramVaeEntry

AT_ONCE = 128


@dataclass(frozen=True)
class TrainedProgramVae:
    """header: what the weights say of themselves."""

    module: ProgramVae
    header: Mapping[str, Any]

    @property
    def latent(self) -> int:
        """Dimensions of the latent space."""
        return int(self.header["settings"]["latent"])

    @torch.no_grad()
    def encode(self, programs: Sequence[Program]) -> Points:
        """Encode programs: posterior means, float32 (n, latent). Raises ProgramError as `node_lines`."""
        means: list[Points] = [np.empty((0, self.latent), np.float32)]
        for start in range(0, len(programs), AT_ONCE):
            read = Programs.of([node_lines(each) for each in programs[start : start + AT_ONCE]])
            means.append(self.module.encode(batch_of(read, np.arange(len(read))))[0].numpy())
        return np.concatenate(means)

    def decode(self, points: Points, *, reject: bool) -> list[Program | None]:
        """A program for each point, float32 (n, latent), as `write_programs`."""
        found: list[Program | None] = []
        for start in range(0, len(points), AT_ONCE):
            found += write_programs(self.module, points[start : start + AT_ONCE], reject=reject)
        return found

    def points(self, count: int, rng: np.random.Generator, temperature: float = 1.0) -> Points:
        """Random points, float32 (count, latent), of where programs stand, as `Standing.points`."""
        return self.module.points(count, rng, temperature)

    def sample(self, count: int, rng: np.random.Generator, temperature: float = 1.0) -> tuple[list[Program], int]:
        """So many programs of random `points`, and how many it took: those that are rejected count too. Raises
        ValueError where nearly all are rejected."""
        kept: list[Program] = []
        drawn = 0
        while len(kept) < count:
            if drawn > 50 * (count + AT_ONCE):
                raise ValueError(f"{len(kept)} of {drawn} random points gave a program; train the model longer")
            for each in self.decode(self.points(AT_ONCE, rng, temperature), reject=True):
                if len(kept) < count:
                    drawn += 1
                    kept += [] if each is None else [each]
        return kept, drawn


def load_program_vae(path: Path, expected: Mapping[str, Any] | None = None) -> TrainedProgramVae:
    """The model in a file of weights, on the CPU.

    Raises CheckpointError for whatever is not one, or says something else of itself than `expected`, such as
    `{"kit": "chair"}`.
    """
    tensors, header = load_checkpoint(path, {"kind": "program_vae", **(expected or {})})
    module = ProgramVae(
        ProgramVaeEntry.model_validate({"name": "trained", "kind": "program_vae", **header["settings"]})
    )
    if module.state_dict().keys() != tensors.keys():
        raise CheckpointError(f"{path} has other tensors than this version of Shapemill: train it again (make train)")
    module.load_state_dict(tensors)
    return TrainedProgramVae(module.eval(), header)
