"""The `points` section of a config."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator

from pipeline.config import StrictModel
from stages.shape.collection.optional_section import OptionalSection
from stages.views.settings import MAX_VIEWS, AnyCameras, RandomCameras, camera_count

SampledSurface = Literal["all", "visible"]


MAX_NOISE_DEVIATIONS = 4.0
"""Noise of scans is cut at this many standard deviations."""


class ScansConfig(StrictModel):
    """Partial clouds: what some cameras see of a shape together."""

    count: int = Field(1, ge=1, le=64, description="scans of each sample, each with cameras of its own")
    points: int = Field(2048, ge=1, le=1_000_000, description="points of each scan")
    cameras: tuple[AnyCameras, ...] = Field(
        (RandomCameras(count=1, min_elevation=-10.0, max_elevation=60.0),),
        min_length=1,
        max_length=64,
        strict=False,
        description="cameras of each scan; a scan has what at least one of them sees",
    )
    depth_noise: float = Field(
        0.0,
        ge=0.0,
        le=0.1,
        description="standard deviation of the normal noise along the line of sight, cut at 4 of them; unit: radii of "
        "the bounding sphere of the shape",
    )

    @model_validator(mode="after")
    def _few_cameras(self) -> ScansConfig:
        if self.camera_count > MAX_VIEWS:
            raise ValueError(f"a scan of {self.camera_count} cameras has more than {MAX_VIEWS}")
        return self

    @property
    def camera_count(self) -> int:
        """The number of cameras of each scan."""
        return sum(map(camera_count, self.cameras))


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
    min_per_part: int = Field(
        0,
        ge=0,
        le=100_000,
        description="least number of uniform points on each part: points of parts with more are replaced, so that the "
        "cloud is no longer uniform by area; a shape with too many parts gets the quotient of `uniform` and their "
        "number; unit: points (0: as the area says)",
    )
    clouds: int = Field(1, ge=1, le=64, description="clouds of each sample, drawn independently")
    scans: ScansConfig | None = Field(
        None, description="partial clouds besides the others: what some cameras see; null: none"
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
        if self.min_per_part > self.uniform:
            raise ValueError(f"min_per_part ({self.min_per_part}) is more than uniform ({self.uniform})")
        if self.farthest > self.pool:
            raise ValueError(f"farthest ({self.farthest}) is more than pool ({self.pool}) holds")
        return self
