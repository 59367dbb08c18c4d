"""What the config says of a model that writes ShapeAssembly programs."""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import Field

from stages.training.model_config import KitModelConfig, LearningSource

Ablation = Literal["nothing", "hierarchy", "macros", "order", "align"]
"""What of the language programs are without (shapeassembly §7.1.1)."""


class ProgramVaeConfig(KitModelConfig):
    """A hierarchical sequence VAE of ShapeAssembly programs (shapeassembly §6). Its kits are the names of
    `shapeassembly.programs` and `shapeassembly.hierarchies`."""

    learns_from: ClassVar[LearningSource] = "programs"

    kind: Literal["program_vae"] = Field(description="a variational autoencoder of ShapeAssembly programs")
    ablate: Ablation = Field(
        "nothing",
        description="what of the language it learns without: `hierarchy`, programs of one assembly, extracted again "
        "from the cuboids; `macros`, cuboids and attachments alone; `order`, lines in random order; `align`, no cuboid "
        "is aligned",
    )
    latent: int = Field(256, ge=1, le=4096, description="dimensions of the latent space, and of the code of a node")
    hidden: int = Field(256, ge=2, le=8192, description="size of the GRUs and of the layers of the line decoder")
    number_weight: float = Field(
        50.0, ge=0, le=10_000, description="weight of the absolute error of numbers, beside the nats of choices"
    )
    kl_weight: float = Field(0.1, ge=0, le=10, description="weight of the divergence from the prior, in nats")
    precision: Literal["auto", "float32", "bfloat16"] = Field(
        "float32",
        description="numbers of the forward pass; its many small layers gain nothing from bfloat16 and lose by turning "
        "numbers into it; `auto`: bfloat16 where the processor or the GPU reckons with it",
    )

    @property
    def prepared(self) -> dict[str, str]:
        return {} if self.ablate == "nothing" else {"without": self.ablate}
