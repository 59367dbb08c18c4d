"""The `shapeassembly` section of a config."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from pipeline.config import StrictModel
from stages.shape.collection.assignment import SplitConfig
from stages.shape.physics.settings import Requirements
from stages.shapeassembly.extraction.settings import Cleaning, Gates, HierarchyFiles, NamedFiles
from stages.shapeassembly.sources import existing_programs

DEFAULT_TOP_P = 0.8
"""Of 360 sampled chairs 83 % are stable (92 % of the real ones) and 29 % share the most frequent structure (8 % of the
real ones). With 0.7, 88 % of 160 are stable, but half of them share one structure.
"""


class ProgramFiles(NamedFiles):
    """Programs of one category of shapes."""

    path: Annotated[Path, AfterValidator(existing_programs)] = Field(
        description="A folder of .txt files, or a tar archive (also .tar.gz, .tar.xz), one program a file."
    )
    folder: str = Field(
        "", description="Only the files below this folder of the archive, such as data/chair; empty for all."
    )
    lists: dict[Literal["val", "test"], str] = Field(
        default_factory=dict,
        description="Published splits: files below `path` that list programs, one a line, such as `{val: "
        "data_splits/chair/val.txt}`. All other programs of the entry are for training; `splits` does not apply to it.",
    )
    edits: int = Field(
        0,
        ge=0,
        le=1_000,
        description="Continuous edits of each accepted program: other numbers, the same structure. Unit: programs.",
    )
    log_std: float = Field(
        0.2, gt=0, le=1, description="Strength of edits: standard deviation of the logarithm of the size along an axis."
    )


class SampledPrograms(NamedFiles):
    """Programs that are sampled from a trained model."""

    dataset: str = Field(
        pattern=r"^[a-z0-9]+(-[a-z0-9]+)*$",
        max_length=64,
        description="Name of the dataset that the model was trained on, in the same output folder.",
    )
    model: str = Field(
        pattern=r"^[a-z][a-z0-9]*(_[a-z0-9]+)*$",
        max_length=32,
        description="Name of the model there, as in training.models.",
    )
    kit: str = Field(description="Category that it was trained on: a name of `programs` or `hierarchies` there.")
    seed: int = Field(0, ge=0, lt=100, description="Which of its trainings, if there are several seeds.")
    samples: int = Field(ge=1, le=10_000_000, description="Programs to sample; duplicates count once.")
    temperature: float = Field(
        1.0,
        gt=0,
        le=10,
        description="For a VAE: factor of the standard deviation of latent points, where 1 is that of the training "
        "programs. For a language model: divisor of the logits.",
    )
    top_p: float = Field(
        DEFAULT_TOP_P,
        gt=0,
        le=1,
        description="A language model samples numbers from the likeliest ones with this total probability.",
    )

    @property
    def folder(self) -> str:
        """The folder of the model, below the output folder."""
        return f"{self.dataset}-models/{self.model}-{self.kit}-{self.seed}"


class RandomPrograms(NamedFiles):
    """Programs that are drawn at random, without a model and without examples."""

    samples: int = Field(ge=1, le=10_000_000, description="Programs to draw that pass every check.")
    max_levels: int = Field(3, ge=1, le=6, description="Maximum depth of assemblies within assemblies.")
    expanded: float = Field(
        0.5, ge=0, le=1, description="Probability that a cuboid that is large enough becomes an assembly."
    )
    stable: bool = Field(True, description="Whether each shape must stand and bear small pushes.")


class ShapeAssemblyConfig(StrictModel):
    """Shapes from ShapeAssembly programs."""

    programs: tuple[ProgramFiles, ...] = Field(
        (), description="Folders and archives of programs; empty for a dataset of another producer."
    )
    hierarchies: tuple[HierarchyFiles, ...] = Field(
        (), description="Part hierarchies from which programs are extracted."
    )
    sampled: tuple[SampledPrograms, ...] = Field((), description="Trained models to sample programs from.")
    random: tuple[RandomPrograms, ...] = Field(
        (), description="Random programs: plates on posts, layers, rows and shelves, within each other."
    )
    extraction: Gates = Field(default_factory=Gates, description="Quality gates of extracted programs.")
    cleaning: Cleaning = Field(default_factory=Cleaning, description="Cleaning of hierarchies before extraction.")
    accept: Literal["executable", "valid"] = Field(
        "executable",
        description="Which programs become samples: all that can be executed, or only those that keep every rule.",
    )
    max_overflow: float = Field(
        0.05, ge=0, description="Maximum excess of cuboids over the bounding box, as a share of its size."
    )
    min_parts: int = Field(1, ge=1, description="Minimum number of leaf cuboids of an executed program.")
    max_parts: int = Field(10_000, ge=1, description="Maximum number of leaf cuboids of an executed program.")
    require: Requirements = Field(
        default_factory=Requirements,
        description="Physical requirements of every shape; others are rejected and counted.",
    )
    splits: SplitConfig = Field(
        default_factory=SplitConfig,
        description="How the samples are shared out; programs that are alike up to continuous parameters stand in one "
        "split.",
    )

    @model_validator(mode="after")
    def _names_differ(self) -> Self:
        names = [entry.name for entry in (*self.programs, *self.hierarchies, *self.sampled, *self.random)]
        if len(set(names)) < len(names):
            raise ValueError(
                f"two entries of programs, hierarchies, sampled and random have one name: {', '.join(names)}"
            )
        return self

    @property
    def has_sources(self) -> bool:
        """Whether the dataset is made of programs."""
        return bool(self.programs or self.hierarchies or self.sampled or self.random)
