"""What is known of how a shape is placed: whether it has a front, and whether it hangs from a ceiling."""

from __future__ import annotations

from dataclasses import dataclass

PRODUCER_WITH_FRONT = "programs"
"""Its shapes have their front at +z."""


@dataclass(frozen=True)
class ShapePlacement:
    """How a shape is placed.

    front_known: whether its front is at +z
    hangs: whether it hangs from a ceiling, so that nothing is said of how it stands
    """

    front_known: bool = False
    hangs: bool = False


def placement_of(producer: str, kit: str) -> ShapePlacement:
    """Return how the shapes of a source are placed."""
    if producer != PRODUCER_WITH_FRONT:
        return ShapePlacement()
    from stages.programs.program import find_program

    return ShapePlacement(front_known=True, hangs=find_program(kit).view_elevation < 0)
