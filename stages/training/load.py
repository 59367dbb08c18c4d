"""The trained models that write ShapeAssembly programs, whatever their kind."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from stages.shapeassembly.syntax.program import AssemblyProgram
from stages.training.checkpoint import read_header
from stages.training.program_lm.trained import load_program_lm
from stages.training.program_vae.trained import load_program_vae


class ProgramSampler(Protocol):
    """What writes programs."""

    def sample(
        self, count: int, rng: np.random.Generator, temperature: float = 1.0
    ) -> tuple[list[AssemblyProgram], int]:
        """So many programs, and how many were begun for them."""


def load_program_sampler(path: Path, expected: Mapping[str, Any], top_p: float) -> ProgramSampler:
    """The model in a file of weights, of either kind. top_p: share of the likeliest numbers that a language model
    draws from. Raises CheckpointError as the loaders of the kinds."""
    if read_header(path).get("kind") == "program_lm":
        return load_program_lm(path, expected, top_p)
    return load_program_vae(path, expected)
