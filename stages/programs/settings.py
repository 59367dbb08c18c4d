"""The `programs` section of a config."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from pipeline.config import StrictModel
from stages.shape.collection.assignment import ShardConfig
from stages.shape.physics.settings import Requirements


class EachValueConfig(StrictModel):
    """How many shapes have each value of each parameter fixed, all others being random (geocode §4)."""

    train: int = Field(30, ge=1, le=1_000_000, description="Shapes of each value in the training split.")
    val: int = Field(3, ge=1, le=1_000_000, description="Shapes of each value in the validation split.")
    test: int = Field(3, ge=1, le=1_000_000, description="Shapes of each value in the test split.")


class RandomSamplingConfig(StrictModel):
    """A plain random sweep: how many shapes, and how they are shared out."""

    samples: int = Field(10_000, ge=3, le=1_000_000_000, description="Shapes in all.")
    val: float = Field(0.1, gt=0, lt=0.5, description="Share of shapes, and of structures, in the validation split.")
    test: float = Field(0.1, gt=0, lt=0.5, description="Share of shapes, and of structures, in the test split.")


class ProgramsConfig(StrictModel):
    """Shapes from a program: a function from parameters to parts."""

    program: str = Field(
        "",
        max_length=200,
        description="Name of the program, such as chair, or the module that holds one of your own, with dots, such as "
        "furniture.bench; empty for a dataset that is made of exemplars.",
    )
    mode: Literal["each_value", "random"] = Field(
        "each_value",
        description="What is sampled: every value of every parameter a number of times, that parameter being visible "
        "and effective; or random shapes, with values of continuous parameters anywhere in their range.",
    )
    each_value: EachValueConfig = Field(
        default_factory=EachValueConfig,
        description="Shapes of each value, for mode each_value. No two shapes are alike; structures recur in splits.",
    )
    random: RandomSamplingConfig = Field(
        default_factory=RandomSamplingConfig,
        description="Shapes of a sweep, for mode sweep. Shapes that are alike up to their continuous parameters stand "
        "in one split; a program with fewer structures than splits is split by values alone, and one with fewer shapes "
        "than asked gives all it has.",
    )
    require: Requirements = Field(
        default_factory=Requirements, description="What every shape must be physically; others are refused and counted."
    )
    splits: ShardConfig = Field(default_factory=ShardConfig, description="How the samples are shared out.")
