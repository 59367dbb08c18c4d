"""The config of a string VAE."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from stages.training.model_config import KitModelConfig


class StringVaeConfig(KitModelConfig):
    """A string VAE (strings §5). The paper gives no sizes; these train in minutes on one core."""

    kind: Literal["string_vae"] = Field("string_vae", description="a variational autoencoder of strings")
    decoder: Literal["plain", "masked", "transformer"] = Field(
        "masked",
        description="`plain`: a GRU, as published; `masked`: the same, restricted to tokens that can still lead to a "
        "string of the grammar; `transformer`: a small transformer, masked too",
    )
    target: Literal["same", "canonical"] = Field(
        "canonical",
        description="target of the decoder: the `same` string that was read, as published, or the `canonical` one of "
        "its graph, so that the latent space need not store the traversal order; strings of `strings.edges: tree` "
        "always are their own target",
    )
    latent: int = Field(64, ge=1, le=4096, description="dimensions of the latent space")
    embedding: int = Field(32, ge=1, le=4096, description="size of a token's embedding")
    hidden: int = Field(
        256, ge=2, le=8192, multiple_of=2, description="size of the GRUs, or width of the transformer; even"
    )
    layers: int = Field(1, ge=1, le=24, description="layers of the decoder")
    cycle_attention: bool = Field(
        True,
        description="whether a masked decoder scores the end of a cycle by attention to its beginning; strings of a "
        "hundred parts need it",
    )
    dropout: float = Field(0.0, ge=0, lt=1, description="dropout of the transformer")
    kl_weight: float = Field(
        0.01, ge=0, le=10, description="weight of the divergence from the prior, in nats, relative to a whole string's"
    )
    anneal_steps: int = Field(
        750,
        ge=0,
        le=1_000_000,
        description="steps over which the weight of the divergence rises along a sigmoid; unit: optimiser steps",
    )
    word_dropout: float = Field(
        0.2, ge=0, lt=1, description="share of the tokens that are hidden from the decoder in training"
    )
    triplet_weight: float = Field(
        0.0, ge=0, le=1000, description="weight of the triplet loss, which brings similar shapes together; 0: none"
    )
    triplet_margin: float = Field(1.0, gt=0, le=1000, description="margin of the triplet loss, in squared distance")
