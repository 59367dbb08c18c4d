"""The config of an encoder of point clouds."""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import Field

from stages.training.model_config import ModelConfig, Subject

Augmentation = Literal["stretch", "jitter", "noise", "partial", "turn"]


class PointEncoderConfig(ModelConfig):
    """A network that embeds the points of clouds: points of one part lie close together, those of two parts apart.

    It learns from all samples of the dataset.
    """

    subject: ClassVar[Subject] = "collection"

    kind: Literal["point_encoder"] = Field(description="an encoder of clouds that tells parts apart")
    max_shapes: int = Field(
        10_000, ge=2, description="shapes of a split to learn from, drawn at random if there are more; unit: shapes"
    )
    points: int = Field(1024, ge=32, le=2048, description="random points of a cloud in a step; unit: points")
    augmentation: tuple[Augmentation, ...] = Field(
        (),
        strict=False,
        description="what changes a cloud before each step, in any combination: `turn` about the up axis, `stretch` "
        "along the axes, `jitter` of sizes and places of parts, `partial` clouds, `noise`",
    )
    batch_size: int = Field(8, ge=1, le=65_536, description="samples of an optimiser step; unit: samples")
    learning_rate: float = Field(6e-3, gt=0, le=1, description="initial rate of Adam; it falls linearly to a twentieth")
    steps: int = Field(
        100, ge=1, le=1_000_000, description="optimiser steps of a round, some fifteen seconds of work; unit: steps"
    )
    max_rounds: int = Field(6, ge=1, le=10_000, description="maximum number of rounds; unit: rounds")
    precision: Literal["auto", "float32", "bfloat16"] = Field(
        "float32", description="precision of the forward pass; `auto`: bfloat16 where processor or GPU support it"
    )
