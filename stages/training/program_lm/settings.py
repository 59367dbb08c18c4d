"""What the config says of a language model of ShapeAssembly programs."""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import Field

from stages.training.model_config import KitModelConfig, LearningSource


class ProgramLmConfig(KitModelConfig):
    """A transformer that writes ShapeAssembly programs token by token. Its kits are the names of
    `shapeassembly.programs` and `shapeassembly.hierarchies`."""

    learns_from: ClassVar[LearningSource] = "programs"

    kind: Literal["program_lm"] = Field(description="a language model of ShapeAssembly programs, masked by their rules")
    width: int = Field(128, ge=2, le=4096, description="size of what the transformer says of a token")
    layers: int = Field(4, ge=1, le=64, description="blocks of the transformer")
    jitter: float = Field(
        0.1, ge=0, le=1, description="share of numbers that it sees a step beside what they are while it learns"
    )
    dropout: float = Field(
        0.0,
        ge=0,
        lt=1,
        description="share of what each block adds that is left out while it learns; a wider model, or a longer "
        "training, learns few programs by heart without it",
    )
