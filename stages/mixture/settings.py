"""The `mixture` section of a config."""

from __future__ import annotations

from typing import Any, Literal, Self

from pydantic import Field, model_validator

from pipeline.config import StrictModel
from stages.shape.collection.assignment import ShardConfig


class MixtureConfig(StrictModel):
    """One dataset of several producers. `mixture: true` is short for `enabled: true`."""

    enabled: bool = Field(
        False,
        description="Whether the samples of all producers that the config asks for are joined; `true` in place of the "
        "section turns it on, too. Otherwise a config asks for one producer.",
    )
    classes: Literal["kit", "label"] = Field(
        "kit",
        description="What a class is. `kit`: a part label of one kit, program or category, as in other datasets. "
        "`label`: a part label, wherever it occurs, so that the legs of chairs and tables are one class.",
    )
    max_samples: dict[str, int] = Field(
        default_factory=dict,
        description="Maximum number of samples of a kit, program or category, by its name, and of each producer that "
        "makes some of it; others are left out at random, the same share of each split.",
    )
    shuffle: bool = Field(
        True,
        description="Whether a shard holds samples of all producers in random order, or those of one after another's.",
    )
    contrast: bool = Field(
        False,
        description="Whether each sample that stands gets a partner with one part removed, shortened or moved, so that "
        "it falls, if such a part is found. Both are in one split, and `lineage.contrast` names partner, edit and "
        "cause. It needs `validity.falls: true`. The dataset of one producer can have it, too.",
    )
    shards: ShardConfig = Field(
        default_factory=ShardConfig, description="How the samples of a split are divided into shards."
    )

    @model_validator(mode="before")
    @classmethod
    def _true_turns_it_on(cls, given: Any) -> Any:
        return {"enabled": given} if isinstance(given, bool) else given

    @model_validator(mode="after")
    def _contrast_needs_a_mixture(self) -> Self:
        if self.contrast and not self.enabled:
            raise ValueError("contrast needs `enabled: true`, also for the samples of one producer")
        return self
