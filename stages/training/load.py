"""The trained models that write ShapeAssembly programs, whatever their kind."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from stages.shapeassembly.syntax.program import Program
from stages.training.checkpoint import weights_header
from stages.training.program_lm.trained import load_program_lm
from stages.training.program_vae.trained import load_program_vae


class ProgramWriter(Protocol):
    """What writes programs."""

    def sample(self, count: int, rng: np.random.Generator, temperature: float = 1.0) -> tuple[list[Program], int]:
        """So many programs, and how many were begun for them."""


def load_program_writer(path: Path, expected: Mapping[str, Any], nucleus: float) -> ProgramWriter:
    """The model in a file of weights, of either kind. nucleus: share of the likeliest numbers that a language model
    draws from. Raises CheckpointError as the loaders of the kinds."""
    if weights_header(path).get("kind") == "program_lm":
        return load_program_lm(path, expected, nucleus)
    return load_program_vae(path, expected)
