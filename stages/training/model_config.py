"""What the config says of every model, whatever its kind: its name, its data, and how long and on what it trains."""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import Field

from pipeline.config import StrictModel

Subject = Literal["kit", "program"]
"""What a model learns from: the samples of a kit, or a program."""

LearningSource = Literal["strings", "shapes", "programs"]
"""What models of a kit learn from: the strings that stage `strings` has written, the shapes themselves, or, where the
kit is a category of ShapeAssembly programs, their texts."""


class ModelConfig(StrictModel):
    """One entry of `training.models`: a model for each of its subjects and each of its seeds.

    subject: what a model of the kind learns from.
    """

    subject: ClassVar[Subject]

    name: str = Field(
        pattern=r"^[a-z][a-z0-9]*(_[a-z0-9]+)*$",
        max_length=32,
        description="what the model is called; its weights stand in `OUT/<dataset>-models/<name>-<subject>-<seed>`, "
        "the subject being a kit or a program; lower-case letters, digits and single underscores",
    )
    seeds: int = Field(1, ge=1, le=100, description="how often it is trained, from other weights; unit: models")
    learning_rate: float = Field(1e-3, gt=0, le=1, description="of Adam at the start; it falls to a twentieth")
    batch_size: int = Field(64, ge=1, le=65_536, description="samples that a step of the optimiser sees; unit: samples")
    steps: int = Field(
        250, ge=1, le=1_000_000, description="steps of a round, a minute or two of work; unit: optimiser steps"
    )
    max_rounds: int = Field(12, ge=1, le=10_000, description="rounds at most; unit: rounds")
    patience: int = Field(
        4, ge=1, le=10_000, description="so many rounds in a row that are no better than the best end it; unit: rounds"
    )
    threads: int = Field(
        1,
        ge=1,
        le=256,
        description="threads of a training, and workers that are put aside for it; another number sums in another "
        "order: other weights; unit: threads",
    )
    device: Literal["auto", "cpu", "cuda"] = Field("auto", description="where it trains; `auto`: a GPU if there is one")
    precision: Literal["auto", "float32", "bfloat16"] = Field(
        "auto",
        description="numbers of the forward pass; `auto`: bfloat16 where the processor or the GPU reckons with it, "
        "else float32, which is faster there",
    )


class KitModelConfig(ModelConfig):
    """A model that learns from the samples of a kit.

    learns_from: what `prepare` of the kind reads.
    """

    subject: ClassVar[Subject] = "kit"
    learns_from: ClassVar[LearningSource] = "strings"

    kits: tuple[str, ...] = Field((), description="the kits that it is trained on, each by itself; all if empty")

    @property
    def prepared(self) -> dict[str, str]:
        """What `prepare` is asked for, beside the samples of a kit: entries that ask for the same share what it
        makes."""
        return {}
