"""The config of a language model of ShapeAssembly programs."""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import Field

from stages.training.model_config import KitModelConfig, LearningSource


class ProgramLmConfig(KitModelConfig):
    """A transformer that generates ShapeAssembly programs token by token.

    Its kits are the names of `shapeassembly.programs` and `shapeassembly.hierarchies`.
    """

    learns_from: ClassVar[LearningSource] = "programs"

    kind: Literal["program_lm"] = Field(description="a language model of ShapeAssembly programs, masked by their rules")
    width: int = Field(128, ge=2, le=4096, description="width of the transformer")
    layers: int = Field(4, ge=1, le=64, description="blocks of the transformer")
    jitter: float = Field(
        0.1, ge=0, le=1, description="share of input numbers that are shifted by one step during training"
    )
    dropout: float = Field(
        0.0,
        ge=0,
        lt=1,
        description="dropout of the blocks; without it, wide models and long trainings memorise small corpora",
    )
