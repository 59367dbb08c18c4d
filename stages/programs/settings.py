"""The `programs` section of a config."""

from __future__ import annotations

from typing import Any, Literal, Self

from pydantic import Field, model_validator

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


class ProgramConfig(StrictModel):
    """Shapes from one program: a function from parameters to parts."""

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


class ProgramsConfig(ProgramConfig):
    """Shapes from one program, or from several."""

    splits: ShardConfig = Field(
        default_factory=ShardConfig, description="How the samples of each program are divided into shards."
    )
    entries: tuple[ProgramConfig, ...] = Field(
        (),
        strict=False,  # a list that a validator has seen is no longer taken for a tuple
        description="Several programs in place of `program`, each with its keys above, all of one mode. A list in "
        "place of the section is short for this key.",
    )

    @model_validator(mode="before")
    @classmethod
    def _list_is_entries(cls, given: Any) -> Any:
        return {"entries": given} if isinstance(given, list) else given

    @model_validator(mode="after")
    def _programs_differ(self) -> Self:
        names = [entry.program for entry in self.entries]
        if self.entries and (self.program or not all(names)):
            raise ValueError("each of several programs is named in its entry, and none by programs.program")
        if len(set(names)) < len(names):
            raise ValueError(f"two entries have one program: {', '.join(names)}")
        if len({entry.mode for entry in self.entries}) > 1:
            raise ValueError("all programs of a dataset are sampled in one mode, all_values or random")
        return self

    @property
    def sampled(self) -> tuple[ProgramConfig, ...]:
        """The programs that the dataset is made of; empty for a dataset of another producer."""
        return self.entries or ((self,) if self.program else ())
