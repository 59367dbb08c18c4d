"""The `autoconfig` section of a config."""

from __future__ import annotations

from pydantic import Field

from pipeline.config import StrictModel

RANDOM_STREAM = "choices"
"""First word of every random stream of auto-configuration; another word would change resolved settings."""


class AutoconfigConfig(StrictModel):
    """How the kit keys left at `auto` are resolved."""

    max_tries: int = Field(
        2500,
        ge=100,
        le=1_000_000,
        description="Tries of a trial search before a setting that finds next to nothing is dropped; a promising "
        "setting gets four times this number.",
    )
