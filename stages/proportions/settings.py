"""The `proportions` section of a config."""

from __future__ import annotations

from pydantic import Field

from pipeline.config import StrictModel
from stages.shape.collection.assignment import SplitConfig
from stages.shape.physics.settings import Requirements

MAX_SAMPLES_PER_KIT = 1_000_000


class ProportionsConfig(StrictModel):
    """The exemplars of all kits in other proportions."""

    samples_per_kit: int = Field(
        0,
        ge=0,
        le=MAX_SAMPLES_PER_KIT,
        description="Shapes of each kit, its exemplars taking turns; 0 for another producer.",
    )
    log_std: float = Field(
        0.25,
        gt=0,
        le=1,
        description="Standard deviation of the logarithm of the size along an axis, and of each length between "
        "the ends of parts. What is round, the whole or a part, seen from above or from a side, stays round.",
    )
    max_factor: float = Field(2.0, gt=1, le=4, description="Maximum factor by which a length grows or shrinks.")
    min_difference: float = Field(
        0.015,
        ge=0,
        lt=1,
        description="Minimum difference of some end of a part from the exemplar, and from each other shape of the "
        "dataset, as a share of the diagonal, with all shapes scaled to equal size.",
    )
    require: Requirements = Field(
        default_factory=Requirements, description="Physical requirements; shapes that fail are rejected and counted."
    )
    parallel_searches: int = Field(4, ge=1, le=64, description="Shards of one kit that draw in parallel.")
    oversample: int = Field(
        8, ge=1, le=1000, description="Maximum number of draws, as a multiple of the requested shapes."
    )
    splits: SplitConfig = Field(
        default_factory=SplitConfig, description="How the samples are divided into splits and shards."
    )
