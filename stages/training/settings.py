"""The config of stage `training`."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from pipeline.config import StrictModel
from stages.training.cuboid_rnn.settings import CuboidRnnConfig
from stages.training.edge_categories.settings import EdgeCategoriesConfig
from stages.training.part_graph_vae.settings import PartGraphVaeConfig
from stages.training.point_encoder.settings import PointEncoderConfig
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
    | PartGraphVaeConfig
    | PointEncoderConfig,
    Field(discriminator="kind"),
]
"""A model of any kind; the key `kind` selects the class."""


class TrainingConfig(StrictModel):
    """The models that `make train` trains. They are no part of the dataset."""

    max_length: int = Field(
        256,
        ge=2,
        le=100_000,
        description="longer strings and programs are not trained on; unit: tokens, words or lines",
    )
    models: tuple[AnyModelConfig, ...] = Field((), description="the models; each is trained independently")

    @model_validator(mode="after")
    def _names_differ(self) -> TrainingConfig:
        names = [model.name for model in self.models]
        duplicates = sorted({name for name in names if names.count(name) > 1})
        if duplicates:
            raise ValueError(f"models of one name: {', '.join(duplicates)}")
        return self
