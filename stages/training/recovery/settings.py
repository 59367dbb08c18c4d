"""What the config says of a model that recovers the parameters of a program."""

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
        (), description="the programs that it is trained on, each by itself; that of the dataset if empty"
    )
    input: Literal["points", "sketch"] = Field(
        "points", description="`points`: a DGCNN reads clouds; `sketch`: a small VGG reads line drawings"
    )
    answers: Literal["classes", "values", "apart"] = Field(
        "classes",
        description="`classes`: the network tells classes of all parameters apart; for comparison, `values`: "
        "continuous ones are regressed, `apart`: and by an encoder of their own",
    )
    existence: bool = Field(True, description="whether that a parameter is hidden is a class that is learnt, too")
    views: tuple[str, ...] = Field(
        (),
        strict=False,
        description="the views of `sketches.views`, by name, that drawings are learnt from; all if empty",
    )
    learning_rate: float = Field(2e-3, gt=0, le=1, description="of Adam at the start; it falls to a twentieth")
    batch_size: int = Field(32, ge=2, le=65_536, description="inputs that a step of the optimiser sees; unit: inputs")
    points: int = Field(512, ge=64, le=100_000, description="points of a cloud that are looked at; unit: points")
    neighbors: int = Field(
        20, ge=1, le=256, description="nearest neighbours that an edge convolution looks at; unit: points"
    )
    widths: tuple[Size, ...] = Field(
        (16, 16, 32, 64), min_length=1, strict=False, description="features of each edge convolution"
    )
    channels: tuple[Size, ...] = Field(
        (32, 32, 64, 64, 128, 64),
        min_length=2,
        max_length=10,
        strict=False,
        description="features of each convolution of the VGG; after each two of them four pixels become one",
    )
    embedding: int = Field(
        64, ge=1, le=4096, description="features that are pooled over the points: their greatest and their mean"
    )
    decoder: tuple[Size, Size] = Field((128, 64), strict=False, description="sizes of the two layers in each decoder")
    dropout: float = Field(0.1, ge=0, lt=1, description="share of a decoder's features that are left out in a step")
    noise: float = Field(
        0.5,
        ge=0,
        le=1,
        description="share of the inputs that are spoilt as scans and hand drawings are; unit: share",
    )
    validation: int = Field(256, ge=1, le=100_000, description="shapes that a round is judged by; unit: shapes")
    pool: int = Field(
        1600,
        ge=1,
        le=1_000_000,
        description="shapes that are made for each round, beside those of the rounds before: it learns from all of "
        "them; unit: shapes",
    )

    @property
    def is_baseline(self) -> bool:
        """Whether it is there to be compared with alone (geocode Table 3)."""
        return self.answers != "classes" or not self.existence
