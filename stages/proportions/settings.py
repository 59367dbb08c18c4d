"""The `proportions` section of a config."""

from __future__ import annotations

from pydantic import Field

from pipeline.config import StrictModel
from stages.shape.collection.assignment import SplitConfig
from stages.shape.physics.settings import Requirements

MAX_SAMPLES_PER_KIT = 1_000_000
"""No more are made of a kit."""


class ProportionsConfig(StrictModel):
    """The exemplars of all kits in other proportions."""

    samples_per_kit: int = Field(
        0,
        ge=0,
        le=MAX_SAMPLES_PER_KIT,
        description="Shapes wanted of each kit, its exemplars taking turns; 0 for a dataset that is made in another "
        "way.",
    )
    log_std: float = Field(
        0.25,
        gt=0,
        le=1,
        description="How far proportions go: standard deviation of the logarithm of the size along an axis, and of the "
        "length of what lies between the ends of parts.",
    )
    max_factor: float = Field(
        2.0, gt=1, le=4, description="How many times longer or shorter than it is a length is made at most."
    )
    min_difference: float = Field(
        0.015,
        ge=0,
        lt=1,
        description="How far some end of a part must have moved at least against the exemplar, and against each other "
        "shape of the dataset, as a share of the diagonal, all of them being made equally large.",
    )
    require: Requirements = Field(
        default_factory=Requirements, description="What every shape must be physically; others are refused and counted."
    )
    parallel_searches: int = Field(4, ge=1, le=64, description="Shards of one kit that draw beside each other.")
    oversample: int = Field(8, ge=1, le=1000, description="Draws at most, as a multiple of the shapes wanted.")
    splits: SplitConfig = Field(default_factory=SplitConfig, description="How the samples are shared out.")
