"""A trained language model of ShapeAssembly programs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from stages.shapeassembly.settings import DEFAULT_TOP_P
from stages.shapeassembly.syntax.program import AssemblyProgram
from stages.training.checkpoint import load_module
from stages.training.program_lm.model import ProgramLm
from stages.training.program_lm.sampling import SamplingOptions, sample_programs
from stages.training.program_lm.settings import ProgramLmConfig


@dataclass(frozen=True)
class TrainedProgramLm:
    """A language model of programs with its header.

    top_p: numbers are sampled from the likeliest ones with this total probability.
    """

    module: ProgramLm
    header: Mapping[str, Any]
    top_p: float = DEFAULT_TOP_P

    def sample(
        self, count: int, rng: np.random.Generator, temperature: float = 1.0
    ) -> tuple[list[AssemblyProgram], int]:
        """Sample programs. Returns the programs and the number of attempts; abandoned programs are attempts too.

        Each program is finished before the next one is counted, so that long programs are not underrepresented.
        Raises ValueError where nearly all are abandoned.
        """
        programs: list[AssemblyProgram] = []
        attempts = 0
        options = SamplingOptions(temperature, self.top_p)
        while len(programs) < count:
            if attempts > 50 * count + 200:
                raise ValueError(f"{len(programs)} of {attempts} programs were finished; train the model longer")
            missing = count - len(programs)
            sampled = sample_programs(self.module, self.header["unit"], missing, options, rng)
            programs += [program for program in sampled if program is not None]
            attempts += missing
        return programs, attempts


def load_program_lm(
    path: Path, expected: Mapping[str, Any] | None = None, top_p: float = DEFAULT_TOP_P
) -> TrainedProgramLm:
    """Read the model in a file of weights, as `load_module`. expected: such as `{"kit": "chair"}`."""
    kind = {"kind": "program_lm", **(expected or {})}
    module, header = load_module(
        path, kind, ProgramLmConfig, lambda config, header: ProgramLm(config, header["longest"])
    )
    return TrainedProgramLm(module, header, top_p)
