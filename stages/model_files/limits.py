"""Limits of reading a model file."""

from __future__ import annotations

from pydantic import Field

from pipeline.config import StrictModel


class ReadLimits(StrictModel):
    """Limits of reading one model; a model beyond them is refused."""

    cpu_seconds: int = Field(300, ge=1, le=86_400, description="Most CPU seconds of reading one model.")
    memory_mb: int = Field(4_000, ge=100, description="Most memory of reading one model; unit: MB.")
    parts: int = Field(20_000, ge=1, description="Most parts of one model.")
    triangles: int = Field(
        5_000_000,
        ge=1,
        description="Most triangles of one model; those of a mesh that is placed often count once.",
    )
