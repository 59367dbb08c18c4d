"""The `variations` section of a config."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from pipeline.config import StrictModel

__all__ = ["SearchConfig", "SplitConfig", "VariationsConfig"]


class SearchConfig(StrictModel):
    """How variants are searched for."""

    matching: Literal["pose", "centroid"] = Field(
        "pose",
        description="How a boundary is found in another shape: by relative poses modulo symmetry, or by the paper's "
        "types and centroid distances.",
    )
    duplicates: Literal["docking", "graph", "histogram"] = Field(
        "docking",
        description="When two shapes are the same: same graph and docking configurations, same graph, or (the paper's "
        "rule) same numbers of parts of each type.",
    )
    upright: bool = Field(
        True,
        description="Whether pieces are turned about the vertical only; set it to false for what floats in space.",
    )
    smallest: float = Field(
        0.5, gt=0, le=1, description="Fewest parts of a variant, as a share of the smallest exemplar's."
    )
    largest: float = Field(
        2.0, ge=1, le=20, description="Most parts of a variant, as a share of the largest exemplar's."
    )
    growth_share: float = Field(
        0.3, ge=0, le=1, description="Share of pieces grown part by part; the rest are cut by half-space, slab or box."
    )
    exemplar_share: float = Field(
        0.15, ge=0, le=1, description="Share of parents drawn from the exemplars; the rest are earlier variants."
    )
    parents: int = Field(2000, ge=1, description="Most earlier variants that one shard of the search holds as parents.")
    lanes: int = Field(2, ge=1, le=64, description="Shards of the search that run beside each other in a round.")
    tries: int = Field(20_000, ge=1, description="Most tries of one lane in one round.")
    patience: int = Field(
        200_000, ge=1, description="Tries of a kit without a new variant after which its search has ended."
    )
    rounds: int = Field(200, ge=1, description="Most rounds of a kit's search.")


class SplitConfig(StrictModel):
    """How the samples are shared out."""

    val: float = Field(0.1, gt=0, lt=0.5, description="Share of distinct graphs in the validation split.")
    test: float = Field(0.1, gt=0, lt=0.5, description="Share of distinct graphs in the test split.")
    shards: int = Field(8, ge=1, description="Fewest shards of a split.")
    samples_per_shard: int = Field(512, ge=1, description="Most samples of a shard.")


class VariationsConfig(StrictModel):
    """The variations of each kit."""

    per_kit: int = Field(500, ge=1, description="Variants wanted of each kit.")
    search: SearchConfig = Field(default_factory=SearchConfig, description="How variants are searched for.")
    splits: SplitConfig = Field(default_factory=SplitConfig, description="How the samples are shared out.")
