"""A target: what shapes are compared with while their parameters are searched for."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from stages.programs.curves.part import Part


class RecoveryTarget(Protocol):
    """A cloud or a drawing, placed in a program's coordinates. Its methods return new targets.

    Distances are mean squared distances to the nearest point, both ways, added. Their unit is the longest side of the
    box around the target.
    """

    def compared(self, parts: Sequence[Part]) -> tuple[float, RecoveryTarget]:
        """The distance of a shape, and the target where it was placed for that."""

    def aligned(self, parts: Sequence[Part]) -> RecoveryTarget:
        """The target aligned to a shape as well as possible."""

    def floor(self, parts: Sequence[Part], rng: np.random.Generator) -> float:
        """The distance of a shape from a target sampled from it: the least that any input can have."""
