"""The `validity` section of a config."""

from __future__ import annotations

from pydantic import Field

from stages.shape.physics.settings import PhysicsConfig


class ValidityConfig(PhysicsConfig):
    """What statics assumes, and whether samples are dropped, too."""

    falls: bool = Field(
        False,
        description="Whether records say of each shape if it falls when it is dropped and pushed by a tenth of its "
        "weight, with the tilt that it bears. Connected parts are one rigid body in this.",
    )
