"""The config of a model of edge categories."""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import Field

from stages.training.model_config import KitModelConfig, LearningSource


class EdgeCategoriesConfig(KitModelConfig):
    """A model of edge categories (strings §6). The paper gives no sizes; these train in minutes on one core."""

    learns_from: ClassVar[LearningSource] = "shapes"

    kind: Literal["edge_categories"] = Field(
        description="predicts from a string how each part is placed relative to its parent"
    )
    decoder: Literal["lstm", "autoregressive"] = Field(
        "autoregressive",
        description="`lstm`: a bidirectional LSTM and a dense layer that classifies each token independently "
        "(strings §6); `autoregressive`: the same LSTM, and a transformer that places parts one after another, so that "
        "choices agree with earlier ones",
    )
    learning_rate: float = Field(3e-3, gt=0, le=1, description="initial rate of Adam; it falls linearly to a twentieth")
    batch_size: int = Field(32, ge=1, le=65_536, description="strings of an optimiser step; unit: strings")
    steps: int = Field(
        200, ge=1, le=1_000_000, description="optimiser steps of a round, one or two minutes of work; unit: steps"
    )
    max_rounds: int = Field(9, ge=1, le=10_000, description="maximum number of rounds; unit: rounds")
    mask: bool = Field(True, description="whether only categories of a token's pair of labels have a probability")
    embedding: int = Field(32, ge=1, le=4096, description="size of a token's embedding")
    hidden: int = Field(
        128, ge=2, le=8192, multiple_of=2, description="size of both LSTM directions together, and of the transformer"
    )
    layers: int = Field(1, ge=1, le=24, description="layers of the LSTM, and of the transformer")
