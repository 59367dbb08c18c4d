"""The `surface` section of a config."""

from __future__ import annotations

from pydantic import Field

from pipeline.config import StrictModel


class DistanceConfig(StrictModel):
    """Points with their signed distance to the surface of the union."""

    near: int = Field(0, ge=0, le=10_000_000, description="Number of points near the surface.")
    uniform: int = Field(0, ge=0, le=10_000_000, description="Number of points anywhere in the cube around the shape.")
    spread: float = Field(
        0.01,
        gt=0,
        le=1,
        description="Standard deviation of the near points from the surface along each axis, as a share of the longest "
        "side of the shape.",
    )


class SurfaceConfig(StrictModel):
    """What is derived from the surfaces of the parts; without any of it the stage has nothing to do."""

    flags: bool = Field(
        False,
        description="Whether the record says of each part whether its surface is closed, manifold and intersects "
        "itself. The checks are exact.",
    )
    union: bool = Field(
        False,
        description="Whether a sample has the watertight union of its parts as a mesh. Samples with an open part, or "
        "with a part whose surface crosses itself, have no union, and are rejected and counted.",
    )
    distances: DistanceConfig = Field(
        default_factory=DistanceConfig,
        description="Points with signed distances to the union, negative inside. Samples without a union are rejected.",
    )
    occupancy: int = Field(
        0,
        ge=0,
        le=512,
        multiple_of=8,
        description="Cells along each side of the occupancy grid of the union, a multiple of 8; 0 for no grid. Samples "
        "without a union are rejected.",
    )
    padding: float = Field(
        0.05,
        ge=0,
        le=1,
        description="Margin on each side of the cube for uniform points and the grid, as a share of the longest side "
        "of the shape.",
    )

    @property
    def needs_union(self) -> bool:
        """Whether something is asked for that only shapes with an inside have."""
        return self.union or self.point_count > 0 or self.occupancy > 0

    @property
    def point_count(self) -> int:
        """Number of points with signed distances."""
        return self.distances.near + self.distances.uniform

    @property
    def is_requested(self) -> bool:
        """Whether the config asks for anything."""
        return self.flags or self.needs_union
