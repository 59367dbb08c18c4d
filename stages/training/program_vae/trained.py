"""A trained VAE of ShapeAssembly programs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from stages.shapeassembly.syntax.program import AssemblyProgram
from stages.training.checkpoint import load_module
from stages.training.latent import LatentPoints
from stages.training.program_vae.batches import ProgramCorpus, batch_of
from stages.training.program_vae.decoding import decode_programs
from stages.training.program_vae.lines import assembly_lines
from stages.training.program_vae.model import ProgramVae
from stages.training.program_vae.settings import ProgramVaeConfig

PROGRAMS_PER_BATCH = 128


@dataclass(frozen=True)
class TrainedProgramVae:
    """A VAE of programs with its header."""

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
            read = ProgramCorpus.of(
                [assembly_lines(program) for program in programs[start : start + PROGRAMS_PER_BATCH]]
            )
            means.append(self.module.encode(batch_of(read, np.arange(len(read))))[0].numpy())
        return np.concatenate(means)

    def decode(self, points: LatentPoints, *, reject: bool) -> list[AssemblyProgram | None]:
        """Decode latent points, float32 (n, latent), as `decode_programs`."""
        programs: list[AssemblyProgram | None] = []
        for start in range(0, len(points), PROGRAMS_PER_BATCH):
            programs += decode_programs(self.module, points[start : start + PROGRAMS_PER_BATCH], reject=reject)
        return programs

    def sample_points(self, count: int, rng: np.random.Generator, temperature: float = 1.0) -> LatentPoints:
        """Draw points of the aggregate posterior, as `LatentGaussian.sample_points`."""
        return self.module.sample_points(count, rng, temperature)

    def sample(
        self, count: int, rng: np.random.Generator, temperature: float = 1.0
    ) -> tuple[list[AssemblyProgram], int]:
        """Sample programs. Returns the programs and the number of attempts; rejected programs are attempts too.

        temperature: as in `LatentGaussian.sample_points`.
        Raises ValueError where nearly all are rejected.
        """
        programs: list[AssemblyProgram] = []
        attempts = 0
        while len(programs) < count:
            if attempts > 50 * (count + PROGRAMS_PER_BATCH):
                raise ValueError(f"{len(programs)} of {attempts} random points gave a program; train the model longer")
            for program in self.decode(self.sample_points(PROGRAMS_PER_BATCH, rng, temperature), reject=True):
                if len(programs) < count:
                    attempts += 1
                    programs += [] if program is None else [program]
        return programs, attempts


def load_program_vae(path: Path, expected: Mapping[str, Any] | None = None) -> TrainedProgramVae:
    """Read the model in a file of weights, as `load_module`. expected: such as `{"kit": "chair"}`."""
    kind = {"kind": "program_vae", **(expected or {})}
    return TrainedProgramVae(*load_module(path, kind, ProgramVaeConfig, lambda config, _: ProgramVae(config)))
