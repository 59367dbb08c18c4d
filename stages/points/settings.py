"""The `points` section of a config."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator

from stages.shape.collection.optional_section import OptionalSection

SampledSurface = Literal["all", "visible"]


class PointsConfig(OptionalSection):
    """How many points each sample gets, and where they lie."""

    uniform: int = Field(
        2048, ge=0, le=1_000_000, description="points drawn uniformly by area; unit: points (0: none of this kind)"
    )
    farthest: int = Field(
        0,
        ge=0,
        le=100_000,
        description="points picked by farthest-point sampling out of `pool`; they come before the uniform ones; "
        "unit: points (0: none of this kind)",
    )
    surface: SampledSurface = Field(
        "all",
        description="all: every surface, also inside other parts; visible: what a scanner sees, points from "
        "which a straight line in one of 64 directions leaves the shape",
    )
    pool: int = Field(
        30_000, ge=1, le=10_000_000, description="uniform points that the farthest are picked from; unit: points"
    )
    normalize: Literal["none", "unit_sphere", "unit_box"] = Field(
        "none",
        description="none: the coordinates of the mesh, in the kit's units; unit_box: box centred at the origin, "
        "longest side 1; unit_sphere: box centred at the origin, farthest vertex at distance 1",
    )

    @model_validator(mode="after")
    def _some_points(self) -> PointsConfig:
        if self.uniform + self.farthest == 0:
            raise ValueError("uniform and farthest are both 0: a cloud needs points; `points: false` makes no clouds")
        if self.farthest > self.pool:
            raise ValueError(f"farthest ({self.farthest}) is more than pool ({self.pool}) holds")
        return self
