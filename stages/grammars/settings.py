"""The `grammars` section of a config."""

from __future__ import annotations

from typing import Literal, Self

from pydantic import Field, field_validator, model_validator

from pipeline.config import ExistingFile, StrictModel
from stages.shape.collection.assignment import SplitConfig
from stages.shape.collection.origin import Credit

MIN_RADIUS_SHARE, MAX_RADIUS_SHARE = 0.004, 0.1
"""Of similarity, as shares of the longest side."""


class GrammarConfig(StrictModel):
    """One mesh or cloud, and how many shapes of its grammar are made."""

    name: str = Field(
        pattern=r"^[a-z0-9][a-z0-9-]*$",
        max_length=64,
        description="Name of the grammar; starts the keys of its samples.",
    )
    model: ExistingFile = Field(
        description="Model file (GLB, glTF, OBJ, PLY, STL, OFF, DAE), from the run's folder, all of it one mesh; or a "
        "point cloud (PLY without faces; XYZ, XYZN, XYZRGB as text), with or without normals."
    )
    # excluded from what the stage's fingerprint sees: a mended licence makes the card anew and no shape
    credit: Credit = Field(default_factory=Credit, exclude=True, description="Whose the model is.")
    radius: float = Field(
        0.016,
        ge=MIN_RADIUS_SHARE,
        le=MAX_RADIUS_SHARE,
        description="Radius of similarity, as a share of the longest side of the model's box: every neighbourhood of "
        "this size in a shape is one of the model's. Smaller finds more sites, and takes longer.",
    )
    up: Literal["auto", "y", "z"] = Field(
        "auto", description="The axis that points up in the file; `auto` is what the file says, else y."
    )
    upright: bool = Field(
        True,
        description="Whether what points up in the model does so in every shape; if not, pieces are turned over, too.",
    )
    instances: int = Field(
        100, ge=0, le=1_000_000, description="Shapes by random productions; those that look alike count once."
    )
    resized: int = Field(
        100,
        ge=0,
        le=1_000_000,
        description="Shapes by grids with other numbers of cells; those that look alike count once.",
    )
    min_difference: float = Field(
        0.05,
        ge=0,
        lt=1,
        description="Share of what one sees of a shape, its surface by voxels as wide as the radius, that must differ "
        "from the exemplar and from each shape drawn before. A grammar may give fewer shapes than are asked for.",
    )
    max_cells: int = Field(12, ge=1, le=1000, description="Most cells along a row of a resized grid.")
    max_pieces: int = Field(
        40, ge=1, le=400, description="After so many productions a random shape takes what the model has."
    )


class GrammarsConfig(StrictModel):
    """Shapes from the grammars of meshes in one piece."""

    models: tuple[GrammarConfig, ...] = Field(
        (), description="The meshes; none for a dataset that is made in another way."
    )
    splits: SplitConfig = Field(
        default_factory=SplitConfig, description="How the samples are shared out; no shape comes twice."
    )

    @field_validator("models")
    @classmethod
    def _names_differ(cls, models: tuple[GrammarConfig, ...]) -> tuple[GrammarConfig, ...]:
        names = [each.name for each in models]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"two grammars are named {name!r}; give each its own name")
        return models

    @model_validator(mode="after")
    def _something_is_made(self) -> Self:
        for each in self.models:
            if not each.instances and not each.resized:
                raise ValueError(f"grammar {each.name} makes nothing; set instances or resized")
        return self
