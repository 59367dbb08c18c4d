"""The `programs` section of a config."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from pipeline.config import StrictModel
from stages.shape.collection.assignment import ShardConfig
from stages.shape.physics.settings import Requirements


class AllValuesConfig(StrictModel):
    """Shapes with each value of each parameter fixed and all others random (geocode §4)."""

    train: int = Field(30, ge=1, le=1_000_000, description="Shapes of each value in the training split.")
    val: int = Field(3, ge=1, le=1_000_000, description="Shapes of each value in the validation split.")
    test: int = Field(3, ge=1, le=1_000_000, description="Shapes of each value in the test split.")


class RandomSamplingConfig(StrictModel):
    """Random shapes: how many, and how they are divided."""

    samples: int = Field(10_000, ge=3, le=1_000_000_000, description="Shapes in all.")
    val: float = Field(0.1, gt=0, lt=0.5, description="Share of shapes, and of structures, in the validation split.")
    test: float = Field(0.1, gt=0, lt=0.5, description="Share of shapes, and of structures, in the test split.")


class ProgramsConfig(StrictModel):
    """Shapes from a program: a function from parameters to parts."""

    program: str = Field(
        "",
        max_length=200,
        description="Name of the program, such as chair, or the dotted module of your own, such as furniture.bench; "
        "empty for a dataset made from exemplars.",
    )
    mode: Literal["all_values", "random"] = Field(
        "all_values",
        description="What is sampled. all_values: every value of every parameter a number of times, where it "
        "is visible and takes effect. random: random shapes, with continuous values anywhere in their range.",
    )
    all_values: AllValuesConfig = Field(
        default_factory=AllValuesConfig,
        description="Shapes of each value, for mode all_values. There are no duplicates; structures recur in splits.",
    )
    random: RandomSamplingConfig = Field(
        default_factory=RandomSamplingConfig,
        description="Random shapes, for mode random. Shapes that differ in continuous parameters alone are in one "
        "split. A program with fewer structures than splits is split by values, and one with too few shapes gives all.",
    )
    require: Requirements = Field(
        default_factory=Requirements, description="Physical requirements; other shapes are rejected and counted."
    )
    splits: ShardConfig = Field(default_factory=ShardConfig, description="How the samples are divided into shards.")
