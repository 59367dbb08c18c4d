"""The config of stage `training`."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from pipeline.config import StrictModel
from stages.training.cuboid_rnn.settings import CuboidRnnConfig
from stages.training.edge_categories.settings import EdgeCategoriesConfig
from stages.training.part_graph_vae.settings import PartGraphVaeConfig
from stages.training.program_lm.settings import ProgramLmConfig
from stages.training.program_vae.settings import ProgramVaeConfig
from stages.training.recovery.settings import RecoveryModelConfig
from stages.training.string_vae.settings import StringVaeConfig

AnyModelConfig = Annotated[
    StringVaeConfig
    | EdgeCategoriesConfig
    | RecoveryModelConfig
    | ProgramVaeConfig
    | ProgramLmConfig
    | CuboidRnnConfig
    | PartGraphVaeConfig,
    Field(discriminator="kind"),
]
"""An entry of any kind, which its key `kind` tells."""


class TrainingConfig(StrictModel):
    """Which models are trained. None belongs to the dataset: `make train` trains them."""

    max_length: int = Field(
        256, ge=2, le=100_000, description="longer strings are left out of the training of models; unit: tokens"
    )
    models: tuple[AnyModelConfig, ...] = Field((), description="the models; each is trained by itself")

    @model_validator(mode="after")
    def _names_differ(self) -> TrainingConfig:
        names = [each.name for each in self.models]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"models of one name: {', '.join(twice)}")
        return self
