"""The `choices` section of a config."""

from __future__ import annotations

from pydantic import Field

from pipeline.config import StrictModel


class AutoconfigConfig(StrictModel):
    """How keys of kits that are `auto` are chosen."""

    max_tries: int = Field(
        2500,
        ge=100,
        le=1_000_000,
        description="Tries of a search after which a setting under which it finds next to nothing is given up; a "
        "promising one gets four times as many.",
    )
