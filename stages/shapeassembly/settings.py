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
"""Of 360 chairs that a language model wrote 83 % stay up, of the real ones 92 %, and about 29 % have the commonest
structure, of the real ones 8 %; with 0.7 it is 88 % of 160, and half of them have one structure."""


class ProgramFiles(NamedFiles):
    """Programs of one kind of shape."""

    path: Annotated[Path, AfterValidator(existing_programs)] = Field(
        description="A folder of .txt files, or a tar archive (also .tar.gz, .tar.xz), one program a file."
    )
    folder: str = Field(
        "", description="Only the files below this folder of the archive, such as data/chair; empty for all."
    )
    lists: dict[Literal["val", "test"], str] = Field(
        default_factory=dict,
        description="Splits that were published: files below `path` that name programs, one a line, such as `{val: "
        "data_splits/chair/val.txt}`. The named programs make the split, all others of the entry are for training, and "
        "`splits` shares out none of them.",
    )
    edits: int = Field(
        0,
        ge=0,
        le=1_000,
        description="So many continuous edits of each accepted program: other sizes and places of attachment, the same "
        "structure. Unit: programs.",
    )
    spread: float = Field(
        0.2, gt=0, le=1, description="How far edits go: standard deviation of the logarithm of the size along an axis."
    )


class SampledPrograms(NamedFiles):
    """Programs that a trained model writes."""

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
    kit: str = Field(description="What it has learnt: a name of `programs` or `hierarchies` there.")
    seed: int = Field(0, ge=0, lt=100, description="Which of its trainings, if it has several seeds.")
    samples: int = Field(
        ge=1, le=10_000_000, description="Programs that it writes; those that it writes twice count once."
    )
    temperature: float = Field(
        1.0,
        gt=0,
        le=10,
        description="Of a VAE the spread of the points of its latent space, 1 being that of the programs it has learnt "
        "of; of a language model how evenly it draws words, 1 being as it says.",
    )
    top_p: float = Field(
        DEFAULT_TOP_P,
        gt=0,
        le=1,
        description="A language model draws each number among the likeliest that have this share together.",
    )

    @property
    def folder(self) -> str:
        """The folder of the model, below the output folder."""
        return f"{self.dataset}-models/{self.model}-{self.kit}-{self.seed}"


class ShapeAssemblyConfig(StrictModel):
    """Shapes from ShapeAssembly programs."""

    programs: tuple[ProgramFiles, ...] = Field(
        (), description="Where the programs are; none for a dataset that is made in another way."
    )
    hierarchies: tuple[HierarchyFiles, ...] = Field(
        (), description="Where the part hierarchies are from which programs are extracted."
    )
    sampled: tuple[SampledPrograms, ...] = Field((), description="The trained models that write programs.")
    extraction: Gates = Field(default_factory=Gates, description="What an extracted program must pass.")
    cleaning: Cleaning = Field(default_factory=Cleaning, description="How hierarchies are made tidier before.")
    accept: Literal["executable", "valid"] = Field(
        "executable",
        description="Which programs become samples: all that can be executed, or those that keep every rule.",
    )
    overflow: float = Field(
        0.05, ge=0, description="How far cuboids may reach out of the bounding box, as a share of its size."
    )
    min_parts: int = Field(1, ge=1, description="Fewest leaf cuboids of an executed program.")
    max_parts: int = Field(10_000, ge=1, description="Most leaf cuboids of an executed program.")
    require: Requirements = Field(
        default_factory=Requirements, description="What every shape must be physically; others are refused and counted."
    )
    splits: SplitConfig = Field(
        default_factory=SplitConfig,
        description="How the samples are shared out; programs that are alike up to continuous parameters stand in one "
        "split.",
    )

    @model_validator(mode="after")
    def _names_differ(self) -> Self:
        names = [each.name for each in (*self.programs, *self.hierarchies, *self.sampled)]
        if len(set(names)) < len(names):
            raise ValueError(f"two entries of programs, hierarchies and written have one name: {', '.join(names)}")
        return self

    @property
    def has_sources(self) -> bool:
        """Whether the dataset is made of programs."""
        return bool(self.programs or self.hierarchies or self.sampled)
