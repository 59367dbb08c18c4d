"""The settings of the physical checks, and what a config may require of every sample."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from pipeline.config import StrictModel


class PhysicsConfig(StrictModel):
    """The model of statics: contact distances, strength of joints, size of pushes."""

    connected: float = Field(
        0.02,
        ge=0,
        le=0.1,
        description="Largest distance of connected parts, and of a part that stands from the ground, as a share of "
        "the shape's diagonal (of its height and greatest breadth).",
    )
    touching: float = Field(
        0.001,
        gt=0,
        le=0.02,
        description="Largest distance of faces that press on each other, as a share of the shape's diagonal; "
        "parts that reach deeper than this into each other are one piece.",
    )
    joints: Literal["rigid", "dry"] = Field(
        "rigid",
        description="What holds parts together: connected parts are one rigid body (as in the simulations by which "
        "shape programs are judged), or they only press and rub on each other where their faces touch (masonry).",
    )
    tension: float = Field(
        0.0,
        ge=0,
        le=100,
        description="Pull that each dry joint bears, in weights of the whole shape; 0 is a joint without glue.",
    )
    friction: float = Field(0.7, ge=0, le=10, description="Coefficient of friction, of joints and of the ground.")
    push: float = Field(
        0.01,
        ge=0,
        le=1,
        description="Perturbation that a stable shape bears, as a share of its weight: pushes of every part sideways, "
        "up and down, and twists, in proportion to its weight.",
    )


class Requirements(StrictModel):
    """What a sample must satisfy to be kept; by default nothing is required."""

    rooted: bool = Field(False, description="Whether every part must be connected to the ground.")
    stable: bool = Field(False, description="Whether the shape must stand and bear small pushes.")
    physics: PhysicsConfig = Field(
        default_factory=PhysicsConfig,
        description="What they are judged by. Records are judged by the section validity: say the same there.",
    )
