"""The `exports` section of a config."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from pipeline.config import StrictModel
from stages.export.settings import DEFAULT_DENSITY, DEFAULT_SHELL_THICKNESS, ExportSettings


class ExportsConfig(StrictModel):
    """Which formats samples have among their members, and what these assume; by default none."""

    formats: tuple[Literal["urdf", "mjcf", "usd", "obj"], ...] = Field(
        (),
        description="Formats that each sample has as members: for each a `.tar.gz` of the files that `make export` "
        "writes.",
    )
    links: Literal["parts", "bodies"] = Field(
        "parts", description="`parts`: each part is a link; `bodies`: parts that keep their places are one link."
    )
    density: float = Field(DEFAULT_DENSITY, gt=0, description="Density of the material, in kilograms a cubic metre.")
    shell_thickness: float = Field(
        DEFAULT_SHELL_THICKNESS, gt=0, description="Thickness of the walls of open parts, in metres."
    )
    scale: float = Field(1.0, gt=0, description="Length of the unit of the shapes, in metres.")
    fixed_base: bool = Field(False, description="Whether shapes are fixed to the world.")

    @property
    def assumed(self) -> ExportSettings:
        """How shapes become bodies."""
        return ExportSettings(self.links, self.density, self.shell_thickness, self.scale, self.fixed_base)
