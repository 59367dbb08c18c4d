"""The `captions` section of a config."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

from pydantic import Field

from pipeline.config import StrictModel

CaptionLength = Literal["short", "medium", "long"]


class CaptionsConfig(StrictModel):
    """Descriptions of each shape in English; without lengths a sample has none."""

    lengths: tuple[CaptionLength, ...] = Field(
        (),
        description="Which captions each sample has: short, one phrase; medium, two or three sentences; long, up to "
        "twelve sentences. Empty: none.",
    )
    nouns: Mapping[str, str] = Field(
        default_factory=dict,
        description="What a shape of a kit or program is called, by the name of its source, such as "
        "`{space-base: space station}`; others are called by that name.",
    )
