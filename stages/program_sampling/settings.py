"""The `program_sampling` section of a config."""

from __future__ import annotations

from pydantic import Field

from pipeline.config import StrictModel


class ProgramSamplingConfig(StrictModel):
    """How the models of `shapeassembly.sampled` sample programs."""

    programs_per_shard: int = Field(500, ge=1, le=100_000, description="programs in a shard at most; unit: programs")
