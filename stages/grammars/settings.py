"""The `grammars` section of a config."""

from __future__ import annotations

from typing import Literal, Self

from pydantic import Field, field_validator, model_validator

from pipeline.config import ExistingFile, StrictModel
from stages.exemplars.settings import Units
from stages.shape.collection.assignment import SplitConfig
from stages.shape.collection.origin import Credit

MIN_RADIUS_SHARE, MAX_RADIUS_SHARE = 0.004, 0.1
"""Bounds of the radius of similarity, as shares of the longest side."""


class GrammarConfig(StrictModel):
    """One mesh or cloud, and how many shapes of its grammar are made."""

    name: str = Field(
        pattern=r"^[a-z0-9][a-z0-9-]*$",
        max_length=64,
        description="Name of the grammar; starts the keys of its samples.",
    )
    model: ExistingFile = Field(
        description="Model file (GLB, glTF, OBJ, PLY, STL, OFF, DAE), relative to the working directory, read as one "
        "mesh; or a point cloud (PLY without faces, PCD, PTS, PTX, NPY, NPZ, or a table as text), with or without "
        "normals."
    )
    # not part of the stage's fingerprint: a corrected licence changes the card and no shape
    credit: Credit = Field(default_factory=Credit, exclude=True, description="Author and licence of the model.")
    radius: float = Field(
        0.016,
        ge=MIN_RADIUS_SHARE,
        le=MAX_RADIUS_SHARE,
        description="Radius of similarity, as a share of the longest side of the model's box. Every neighbourhood of "
        "this size in a shape occurs in the model. A smaller radius finds more sites and takes longer.",
    )
    up: Literal["auto", "y", "z"] = Field(
        "auto", description="Axis that points up in the file; `auto` takes what the file says, else y."
    )
    units: Units = Field(
        "auto",
        description="Unit of the numbers in the file; shapes are made in metres. `auto` takes what the file says, as "
        "in `exemplars.kits[].units`; a point cloud says nothing.",
    )
    upright: bool = Field(True, description="Whether pieces keep the up axis; without it they may be turned over.")
    random_shapes: int = Field(
        100,
        ge=0,
        le=1_000_000,
        description="Number of shapes by random productions; shapes that look alike count once.",
    )
    resized_grids: int = Field(
        100,
        ge=0,
        le=1_000_000,
        description="Number of shapes by grids with other numbers of cells; shapes that look alike count once.",
    )
    min_difference: float = Field(
        0.05,
        ge=0,
        lt=1,
        description="Smallest share of a shape's surface, in voxels as wide as the radius, that must differ from the "
        "exemplar and from each earlier shape. A grammar may give fewer shapes than requested.",
    )
    max_cells: int = Field(12, ge=1, le=1000, description="Largest number of cells in a row of a resized grid.")
    max_pieces: int = Field(
        40,
        ge=1,
        le=400,
        description="Largest number of random productions in a shape; after them it takes what the model has.",
    )

    @property
    def requested_shapes(self) -> int:
        """Number of shapes by both methods."""
        return self.random_shapes + self.resized_grids


class GrammarsConfig(StrictModel):
    """Shapes from the grammars of meshes in one piece."""

    models: tuple[GrammarConfig, ...] = Field(
        (), description="Meshes and clouds; none for a dataset that is made in another way."
    )
    splits: SplitConfig = Field(
        default_factory=SplitConfig, description="How samples are assigned to splits; no shape occurs twice."
    )

    @field_validator("models")
    @classmethod
    def _names_differ(cls, models: tuple[GrammarConfig, ...]) -> tuple[GrammarConfig, ...]:
        names = [model.name for model in models]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"two grammars are named {name!r}; give each its own name")
        return models

    @model_validator(mode="after")
    def _shapes_are_requested(self) -> Self:
        for model in self.models:
            if not model.requested_shapes:
                raise ValueError(f"grammar {model.name} makes nothing; set random_shapes or resized_grids")
        return self
