"""The config of stage `strings`."""

from __future__ import annotations

from pydantic import Field

from pipeline.config import StrictModel

__all__ = ["StringsConfig"]


class StringsConfig(StrictModel):
    """How many strings each shape gets."""

    strings_per_shape: int = Field(
        8,
        ge=0,
        le=10_000,
        description="distinct random strings of each shape, besides its canonical string; a small shape may have "
        "fewer; unit: strings",
    )
