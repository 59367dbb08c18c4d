"""Config of a model that recovers the parameters of a program."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from stages.training.model_config import ModelConfig, Subject

Size = Annotated[int, Field(ge=1, le=4096)]


class RecoveryModelConfig(ModelConfig):
    """Point clouds or drawings back to parameters (geocode §3.3): an encoder, and a decoder for each parameter."""

    subject: ClassVar[Subject] = "program"

    kind: Literal["recovery"] = Field("recovery", description="parameters of a program from a cloud or a drawing")
    programs: tuple[str, ...] = Field(
        (), description="the programs to train for, one model each; empty: the program of the dataset"
    )
    input: Literal["points", "sketch"] = Field(
        "points", description="`points`: a DGCNN reads clouds; `sketch`: a small VGG reads line drawings"
    )
    prediction: Literal["classes", "regression", "separate_regression"] = Field(
        "classes",
        description="`classes`: every parameter is classified; for comparison, `regression`: continuous ones are "
        "regressed, `separate_regression`: with an encoder of their own",
    )
    learn_hidden: bool = Field(True, description="whether hidden parameters have a class of their own to learn")
    views: tuple[str, ...] = Field(
        (), strict=False, description="names of the views of `sketches.views` to draw from; empty: all"
    )
    learning_rate: float = Field(2e-3, gt=0, le=1, description="of Adam at the start; it falls to a twentieth")
    batch_size: int = Field(32, ge=2, le=65_536, description="inputs that a step of the optimiser sees; unit: inputs")
    points: int = Field(512, ge=64, le=100_000, description="points of a cloud that the network sees; unit: points")
    neighbors: int = Field(20, ge=1, le=256, description="nearest neighbours in an edge convolution; unit: points")
    widths: tuple[Size, ...] = Field(
        (16, 16, 32, 64), min_length=1, strict=False, description="features of each edge convolution"
    )
    channels: tuple[Size, ...] = Field(
        (32, 32, 64, 64, 128, 64),
        min_length=2,
        max_length=10,
        strict=False,
        description="features of each convolution of the VGG; every second one is followed by pooling",
    )
    embedding: int = Field(
        64, ge=1, le=4096, description="features that are pooled over the points, by maximum and by mean"
    )
    decoder: tuple[Size, Size] = Field((128, 64), strict=False, description="sizes of the two layers in each decoder")
    dropout: float = Field(0.1, ge=0, lt=1, description="share of a decoder's features that are dropped in a step")
    augmented_share: float = Field(
        0.5,
        ge=0,
        le=1,
        description="share of the inputs that are corrupted as scans and hand drawings are; unit: share",
    )
    validation_shapes: int = Field(
        256, ge=1, le=100_000, description="shapes that a round is validated on; unit: shapes"
    )
    shapes_per_round: int = Field(
        1600,
        ge=1,
        le=1_000_000,
        description="new shapes of each round, which learns from those of the rounds before as well; unit: shapes",
    )

    @property
    def is_baseline(self) -> bool:
        """Whether the model exists only for comparison (geocode Table 3)."""
        return self.prediction != "classes" or not self.learn_hidden
