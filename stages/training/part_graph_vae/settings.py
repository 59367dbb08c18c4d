"""The config of a VAE of part graphs."""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import Field

from stages.training.model_config import KitModelConfig, LearningSource


class PartGraphVaeConfig(KitModelConfig):
    """A VAE of the part graphs of ShapeAssembly programs: a baseline with hierarchy and contacts, without attachments.

    Its kits are the names of `shapeassembly.programs` and `shapeassembly.hierarchies`.
    """

    learns_from: ClassVar[LearningSource] = "programs"

    kind: Literal["part_graph_vae"] = Field(description="a VAE of part graphs, like StructureNet")
    latent: int = Field(256, ge=1, le=4096, description="dimensions of the latent space")
    hidden: int = Field(256, ge=2, le=8192, description="size of a part's features")
    message_rounds: int = Field(2, ge=0, le=16, description="rounds of messages between touching parts")
    number_weight: float = Field(
        50.0, ge=0, le=10_000, description="weight of the absolute error of numbers, relative to the nats of choices"
    )
    kl_weight: float = Field(0.1, ge=0, le=10, description="weight of the divergence from the prior, in nats")
    precision: Literal["auto", "float32", "bfloat16"] = Field(
        "float32",
        description="precision of the forward pass; its many small layers gain nothing from bfloat16; `auto`: bfloat16 "
        "where processor or GPU support it",
    )
