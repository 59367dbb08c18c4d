"""What the config says of a model of edge categories."""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import Field

from stages.training.model_config import KitModelConfig, LearningSource


class EdgeCategoriesConfig(KitModelConfig):
    """A model of edge categories (strings §6). Sizes are not published: these train in minutes on one core."""

    learns_from: ClassVar[LearningSource] = "shapes"

    kind: Literal["edge_categories"] = Field(
        description="reads from a string where each part stands beside the one that it hangs on"
    )
    decoder: Literal["lstm", "autoregressive"] = Field(
        "autoregressive",
        description="`lstm`: an LSTM that reads a string both ways, and a dense layer that judges each token by itself "
        "(strings §6); `walker`: the same LSTM, and a transformer that walks the string and sees the parts that stand "
        "already, so that a choice agrees with those before it",
    )
    learning_rate: float = Field(3e-3, gt=0, le=1, description="of Adam at the start; it falls to a twentieth")
    batch_size: int = Field(32, ge=1, le=65_536, description="strings that a step of the optimiser sees; unit: strings")
    steps: int = Field(
        200, ge=1, le=1_000_000, description="steps of a round, a minute or two of work; unit: optimiser steps"
    )
    max_rounds: int = Field(9, ge=1, le=10_000, description="rounds at most; unit: rounds")
    mask: bool = Field(True, description="whether only categories of a token's pair of labels have a probability")
    embedding: int = Field(32, ge=1, le=4096, description="numbers that stand for a token")
    hidden: int = Field(
        128, ge=2, le=8192, multiple_of=2, description="size of the LSTM, both ways together, and of the walker; even"
    )
    layers: int = Field(1, ge=1, le=24, description="layers of the LSTM, and of the walker")
