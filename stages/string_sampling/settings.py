"""The `string_sampling` section of a config."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from pipeline.config import StrictModel
from stages.shape.collection.assignment import SplitConfig
from stages.shape.physics.settings import Requirements

SamplingMethod = Literal["gaussian", "prior", "perturbation", "linear", "path"]
"""How strings are drawn from a string VAE (strings §5.2)."""


class SourceConfig(StrictModel):
    """One trained model, and how strings are drawn from it."""

    dataset: str = Field(
        pattern=r"^[a-z0-9]+(-[a-z0-9]+)*$",
        max_length=64,
        description="Name of the dataset that the model was trained on, in the same output folder: its models and its "
        "corpus are read.",
    )
    model: str = Field(
        pattern=r"^[a-z][a-z0-9]*(_[a-z0-9]+)*$",
        max_length=32,
        description="Name of the model there, as in training.models.",
    )
    seed: int = Field(0, ge=0, lt=100, description="Which of its trainings, if it has several seeds.")
    kit: str = Field(description="The kit that it has learnt; the same must stand under exemplars.kits.")
    samples: int = Field(ge=1, le=1_000_000_000, description="Shapes wanted.")
    way: SamplingMethod = Field(
        "gaussian",
        description="How points of its latent space are found: drawn where the training strings stand, as a Gaussian, "
        "or from the prior, or by a search around training strings, on lines between them or on paths along them "
        "(strings §5.2).",
    )
    temperature: float = Field(
        0.7,
        gt=0,
        le=10,
        description="Of the tokens that are written where points are drawn: 1 as the model says how likely they are, "
        "less for likelier ones, and shapes that are more alike.",
    )


class StringSamplingConfig(StrictModel):
    """Shapes that trained models dreamt."""

    sources: tuple[SourceConfig, ...] = Field(
        (), description="The models that shapes are drawn from; none for a dataset that is made otherwise."
    )
    known: Literal["drop", "keep"] = Field(
        "drop",
        description="What becomes of a shape whose graph an exemplar or a training shape has; each sample's lineage "
        "says whether it is new.",
    )
    tries: int = Field(
        4000, ge=1, description="Parts that are put down at most until a string has become a shape; unit: parts."
    )
    mends: int = Field(
        24,
        ge=0,
        description="How often at most a string of which no shape can come is written anew, from the first token that "
        "no arrangement of its parts allows; 0: such strings are refused.",
    )
    upright: bool = Field(
        True, description="Whether every part stands as parts of its type stood in the exemplars, or however it docks."
    )
    require: Requirements = Field(
        default_factory=Requirements, description="What every shape must be physically; others are refused and counted."
    )
    lanes: int = Field(4, ge=1, le=64, description="Shards of one model that draw beside each other in a round.")
    draws: int = Field(64, ge=1, le=100_000, description="Strings, or searches for one, that a lane draws in a round.")
    rounds: int = Field(100, ge=1, description="Most rounds of one model.")
    patience: int = Field(3, ge=1, description="Rounds without a new shape after which a model has no more to say.")
    splits: SplitConfig = Field(default_factory=SplitConfig, description="How the samples are shared out.")
