"""The `abstraction` section of a config."""

from __future__ import annotations

from pydantic import Field

from pipeline.config import StrictModel
from stages.shapeassembly.extraction.settings import Cleaning, Gates


class AbstractionConfig(StrictModel):
    """Samples as ShapeAssembly programs."""

    programs: bool = Field(False, description="Whether each sample gets the program of its parts' boxes.")
    children: int = Field(
        9,
        ge=2,
        le=100,
        description="Cuboids of an assembly at most; more parts are gathered into groups; unit: cuboids.",
    )
    gates: Gates = Field(
        default_factory=lambda: Gates(min_leaves=1, max_leaves=200),
        description="What a program must pass; a sample without one says why.",
    )
    cleaning: Cleaning = Field(default_factory=Cleaning, description="How hierarchies are made tidier before.")
