"""The config of a model, whatever its kind: its name, its samples, and how it trains."""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import Field

from pipeline.config import StrictModel

Subject = Literal["kit", "program", "collection"]
"""What a model learns from: the samples of a kit, a program, or all samples of the dataset."""

LearningSource = Literal["strings", "shapes", "programs"]
"""What a model of a kit learns from: the strings of stage `strings`, the shapes themselves, or the texts of
ShapeAssembly programs, where the kit is a category of programs."""


class ModelConfig(StrictModel):
    """One entry of `training.models`: a model for each of its subjects and each of its seeds.

    subject: what a model of the kind learns from.
    """

    subject: ClassVar[Subject]

    name: str = Field(
        pattern=r"^[a-z][a-z0-9]*(_[a-z0-9]+)*$",
        max_length=32,
        description="name of the model; its folder is `OUT/<dataset>-models/<name>-<subject>-<seed>`, where the "
        "subject is a kit, a program or the dataset; lower-case letters, digits and single underscores",
    )
    seeds: int = Field(1, ge=1, le=100, description="trainings from different initial weights; unit: models")
    learning_rate: float = Field(1e-3, gt=0, le=1, description="initial rate of Adam; it falls linearly to a twentieth")
    batch_size: int = Field(64, ge=1, le=65_536, description="samples of an optimiser step; unit: samples")
    steps: int = Field(
        250, ge=1, le=1_000_000, description="optimiser steps of a round, one or two minutes of work; unit: steps"
    )
    max_rounds: int = Field(12, ge=1, le=10_000, description="maximum number of rounds; unit: rounds")
    patience: int = Field(
        4, ge=1, le=10_000, description="training ends after this many rounds without improvement; unit: rounds"
    )
    threads: int = Field(
        1,
        ge=1,
        le=256,
        description="threads of a training, which reserves as many workers; another number sums in another order and "
        "gives other weights; unit: threads",
    )
    device: Literal["auto", "cpu", "cuda"] = Field("auto", description="training device; `auto`: a GPU if available")
    precision: Literal["auto", "float32", "bfloat16"] = Field(
        "auto",
        description="precision of the forward pass; `auto`: bfloat16 where processor or GPU support it, else float32",
    )


class KitModelConfig(ModelConfig):
    """A model that learns from the samples of a kit.

    learns_from: what `prepare` of the kind reads.
    """

    subject: ClassVar[Subject] = "kit"
    learns_from: ClassVar[LearningSource] = "strings"

    kits: tuple[str, ...] = Field((), description="kits to train on, one model a kit; empty: all")

    @property
    def prepared(self) -> dict[str, str]:
        """What `prepare` needs besides the samples; models with equal values share the prepared samples."""
        return {}
