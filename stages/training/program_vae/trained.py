"""A trained model of ShapeAssembly programs, read from its published weights alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from stages.shapeassembly.syntax.program import AssemblyProgram
from stages.training.checkpoint import CheckpointError, load_checkpoint
from stages.training.latent import LatentPoints
from stages.training.program_vae.batches import ProgramCorpus, batch_of
from stages.training.program_vae.decoding import decode_programs
from stages.training.program_vae.lines import assembly_lines
from stages.training.program_vae.model import ProgramVae
from stages.training.program_vae.settings import ProgramVaeConfig

PROGRAMS_PER_BATCH = 128


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
    def encode(self, programs: Sequence[AssemblyProgram]) -> LatentPoints:
        """Encode programs: posterior means, float32 (n, latent). Raises ProgramError as `assembly_lines`."""
        means: list[LatentPoints] = [np.empty((0, self.latent), np.float32)]
        for start in range(0, len(programs), PROGRAMS_PER_BATCH):
            read = ProgramCorpus.of([assembly_lines(each) for each in programs[start : start + PROGRAMS_PER_BATCH]])
            means.append(self.module.encode(batch_of(read, np.arange(len(read))))[0].numpy())
        return np.concatenate(means)

    def decode(self, points: LatentPoints, *, reject: bool) -> list[AssemblyProgram | None]:
        """A program for each point, float32 (n, latent), as `decode_programs`."""
        found: list[AssemblyProgram | None] = []
        for start in range(0, len(points), PROGRAMS_PER_BATCH):
            found += decode_programs(self.module, points[start : start + PROGRAMS_PER_BATCH], reject=reject)
        return found

    def points(self, count: int, rng: np.random.Generator, temperature: float = 1.0) -> LatentPoints:
        """Random points, float32 (count, latent), of where programs stand, as `Standing.points`."""
        return self.module.points(count, rng, temperature)

    def sample(
        self, count: int, rng: np.random.Generator, temperature: float = 1.0
    ) -> tuple[list[AssemblyProgram], int]:
        """So many programs of random `points`, and how many it took: those that are rejected count too. Raises
        ValueError where nearly all are rejected."""
        kept: list[AssemblyProgram] = []
        drawn = 0
        while len(kept) < count:
            if drawn > 50 * (count + PROGRAMS_PER_BATCH):
                raise ValueError(f"{len(kept)} of {drawn} random points gave a program; train the model longer")
            for each in self.decode(self.points(PROGRAMS_PER_BATCH, rng, temperature), reject=True):
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
        ProgramVaeConfig.model_validate({"name": "trained", "kind": "program_vae", **header["settings"]})
    )
    if module.state_dict().keys() != tensors.keys():
        raise CheckpointError(f"{path} has other tensors than this version of Shapemill: train it again (make train)")
    module.load_state_dict(tensors)
    return TrainedProgramVae(module.eval(), header)
