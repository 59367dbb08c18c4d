"""The `primitives` section of a config."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from pipeline.config import StrictModel
from stages.shape.collection.assignment import SplitConfig
from stages.shape.physics.settings import Requirements

Composition = Literal["heap", "stack", "attached"]
Kind = Literal["box", "cylinder", "sphere", "cone", "torus", "tube", "extrusion", "sweep", "revolution"]
KINDS: tuple[Kind, ...] = ("box", "cylinder", "sphere", "cone", "torus", "tube", "extrusion", "sweep", "revolution")
Probability = Annotated[float, Field(ge=0, le=1)]


class PrimitivesConfig(StrictModel):
    """Compositions of simple solids at random."""

    samples: int = Field(0, ge=0, le=100_000_000, description="Shapes in all; 0 for another producer.")
    compositions: tuple[Composition, ...] = Field(
        ("heap", "stack", "attached"),
        min_length=1,
        description="How solids are put together, one way at random for each shape. heap: dropped one after another. "
        "stack: dropped on top of each other. attached: each grows from the surface of an earlier one.",
    )
    kinds: tuple[Kind, ...] = Field(
        KINDS,
        min_length=1,
        description="Kinds of solids, all equally likely. tube: a ring of rectangular section, round or square. "
        "extrusion: a profile of L, U, T, cross or star, cut from a rectangle. sweep: a round profile along a curve. "
        "revolution: an outline turned about an axis, solid or hollow.",
    )
    min_parts: int = Field(2, ge=1, le=200, description="Minimum number of solids that are drawn for a shape.")
    max_parts: int = Field(
        12, ge=1, le=200, description="Maximum number of solids that are drawn for a shape; copies come on top."
    )
    min_size: float = Field(0.08, gt=0, description="Shortest length that is drawn, of a solid before any scaling.")
    max_size: float = Field(0.6, gt=0, description="Longest length that is drawn. Lengths are log-uniform in between.")
    shrink: float = Field(
        0.75,
        gt=0,
        le=1,
        description="Factor of the lengths of an attached solid for each solid between it and the ground.",
    )
    copies: Probability = Field(
        0.4,
        description="Probability that an attached solid comes several times: mirrored, in a row, or around its parent.",
    )
    require: Requirements = Field(
        Requirements(rooted=True), description="Physical requirements; shapes that fail are rejected and counted."
    )
    splits: SplitConfig = Field(
        default_factory=SplitConfig,
        description="How the samples are divided into splits and shards; shapes of one composition with the same kinds "
        "in the same order are in one split.",
    )

    @model_validator(mode="after")
    def _ranges_rise(self) -> Self:
        if self.min_parts > self.max_parts or self.min_size > self.max_size:
            raise ValueError("min_parts and min_size are at most max_parts and max_size")
        return self
