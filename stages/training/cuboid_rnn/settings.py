"""The config of a network that generates cuboids one after another."""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import Field

from stages.training.model_config import KitModelConfig, LearningSource


class CuboidRnnConfig(KitModelConfig):
    """A recurrent network of the cuboids of ShapeAssembly programs: a baseline without hierarchy and attachments.

    Its kits are the names of `shapeassembly.programs` and `shapeassembly.hierarchies`.
    """

    learns_from: ClassVar[LearningSource] = "programs"

    kind: Literal["cuboid_rnn"] = Field(description="a recurrent network that generates cuboids, like 3D-PRNN")
    hidden: int = Field(256, ge=2, le=8192, description="size of the GRU")
    mixtures: int = Field(20, ge=1, le=256, description="Gaussians in the mixture of a step")
    precision: Literal["auto", "float32", "bfloat16"] = Field(
        "float32",
        description="precision of the forward pass; narrow Gaussians need float32; `auto`: bfloat16 where processor or "
        "GPU support it",
    )
