"""What the config says of a network that writes cuboids one after another."""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import Field

from stages.training.model_config import KitModelConfig, LearningSource


class CuboidRnnConfig(KitModelConfig):
    """A recurrent network of the cuboids that ShapeAssembly programs make: a baseline that knows neither parts of parts
    nor attachments. Its kits are the names of `shapeassembly.programs` and `shapeassembly.hierarchies`."""

    learns_from: ClassVar[LearningSource] = "programs"

    kind: Literal["cuboid_rnn"] = Field(description="a recurrent network that writes cuboids, in the way of 3D-PRNN")
    hidden: int = Field(256, ge=2, le=8192, description="size of the GRU")
    mixtures: int = Field(20, ge=1, le=256, description="the numbers of a step are a mixture of so many Gaussians")
    precision: Literal["auto", "float32", "bfloat16"] = Field(
        "float32",
        description="numbers of the forward pass; narrow Gaussians need float32; `auto`: bfloat16 where the processor "
        "or the GPU reckons with it",
    )
