"""A trained language model of ShapeAssembly programs, read from its published weights alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from stages.shapeassembly.settings import DEFAULT_TOP_P
from stages.shapeassembly.syntax.program import AssemblyProgram
from stages.training.checkpoint import CheckpointError, load_checkpoint
from stages.training.program_lm.model import ProgramLm
from stages.training.program_lm.sampling import SamplingOptions, sample_programs
from stages.training.program_lm.settings import ProgramLmConfig


@dataclass(frozen=True)
class TrainedProgramLm:
    """header: what the weights say of themselves; top_p: share of the likeliest numbers that are drawn from."""

    module: ProgramLm
    header: Mapping[str, Any]
    top_p: float = DEFAULT_TOP_P

    def sample(
        self, count: int, rng: np.random.Generator, temperature: float = 1.0
    ) -> tuple[list[AssemblyProgram], int]:
        """So many programs, and how many were begun for them: those that are given up count too. Raises ValueError
        where nearly all are given up.

        Each is written to its end, so that long ones are not passed over for being slow.
        """
        kept: list[AssemblyProgram] = []
        begun = 0
        while len(kept) < count:
            if begun > 50 * count + 200:
                raise ValueError(f"{len(kept)} of {begun} programs were written to an end; train the model longer")
            more = count - len(kept)
            found = sample_programs(
                self.module, self.header["unit"], more, SamplingOptions(temperature, self.top_p), rng
            )
            kept += [each for each in found if each is not None]
            begun += more
        return kept, begun


def load_program_lm(
    path: Path, expected: Mapping[str, Any] | None = None, top_p: float = DEFAULT_TOP_P
) -> TrainedProgramLm:
    """The model in a file of weights, on the CPU.

    Raises CheckpointError for whatever is not one, or says something else of itself than `expected`, such as
    `{"kit": "chair"}`.
    """
    tensors, header = load_checkpoint(path, {"kind": "program_lm", **(expected or {})})
    entry = ProgramLmConfig.model_validate({"name": "trained", "kind": "program_lm", **header["settings"]})
    module = ProgramLm(entry, header["longest"])
    if module.state_dict().keys() != tensors.keys():
        raise CheckpointError(f"{path} has other tensors than this version of Shapemill: train it again (make train)")
    module.load_state_dict(tensors)
    return TrainedProgramLm(module.eval(), header, top_p)
