"""The config of a VAE of ShapeAssembly programs."""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import Field

from stages.training.model_config import KitModelConfig, LearningSource

Ablation = Literal["nothing", "hierarchy", "macros", "order", "align"]
"""The part of the language that programs lack (shapeassembly §7.1.1)."""


class ProgramVaeConfig(KitModelConfig):
    """A hierarchical sequence VAE of ShapeAssembly programs (shapeassembly §6).

    Its kits are the names of `shapeassembly.programs` and `shapeassembly.hierarchies`.
    """

    learns_from: ClassVar[LearningSource] = "programs"

    kind: Literal["program_vae"] = Field(description="a variational autoencoder of ShapeAssembly programs")
    ablate: Ablation = Field(
        "nothing",
        description="part of the language to train without: `hierarchy`: programs of one assembly, extracted again "
        "from the cuboids; `macros`: only cuboids and attachments; `order`: lines in random order; `align`: no aligned "
        "cuboids",
    )
    latent: int = Field(256, ge=1, le=4096, description="dimensions of the latent space, and of an assembly's code")
    hidden: int = Field(256, ge=2, le=8192, description="size of the GRUs and of the layers of the line decoder")
    number_weight: float = Field(
        50.0, ge=0, le=10_000, description="weight of the absolute error of numbers, relative to the nats of choices"
    )
    kl_weight: float = Field(0.1, ge=0, le=10, description="weight of the divergence from the prior, in nats")
    precision: Literal["auto", "float32", "bfloat16"] = Field(
        "float32",
        description="precision of the forward pass; its many small layers gain nothing from bfloat16 and lose by the "
        "conversions; `auto`: bfloat16 where processor or GPU support it",
    )

    @property
    def prepared(self) -> dict[str, str]:
        return {} if self.ablate == "nothing" else {"ablate": self.ablate}
