"""The base of config sections whose stage a dataset can do without."""

from __future__ import annotations

from typing import Any

from pydantic import Field, model_validator

from pipeline.config import StrictModel


class OptionalSection(StrictModel):
    """A section that says whether samples get what its stage adds. `points: false` is short for `enabled: false`."""

    enabled: bool = Field(
        True, description="whether samples get what this stage adds; `false` in place of the section turns it off, too"
    )

    @model_validator(mode="before")
    @classmethod
    def _false_turns_it_off(cls, given: Any) -> Any:
        return {"enabled": False} if given is False else given
