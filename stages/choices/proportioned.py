"""Where a search of layouts gives too little: can the models be made in other proportions?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.randomness import decision_rng
from stages.proportions.faults import warp_fault
from stages.proportions.settings import ProportionsConfig
from stages.proportions.stage import farthest_first
from stages.proportions.warp import Warp, lattice_of, warped
from stages.shape.kit import Kit
from stages.shape.physics.judge import unmet
from stages.shape.physics.settings import Requirements
from stages.shape.shape import Shape, kit_shape

__all__ = ["Proportioned", "in_proportions"]

TRIES = 36
"""Draws of a probe, of all exemplars together."""
LEAST = 0.2
"""Share of them that must hold together; with less a run ends before it has what it wants."""


@dataclass(frozen=True)
class Proportioned:
    """What other proportions of a kit's exemplars promise.

    holds: share of the draws that hold together; shapes: of these the most different, at most as many as asked for;
    stable: whether a dataset should ask that shapes stand, for all exemplars do; enough: whether it is worth one.
    """

    holds: float
    shapes: Sequence[Shape]
    stable: bool

    @property
    def enough(self) -> bool:
        return self.holds >= LEAST


def in_proportions(kit: Kit, shown: int) -> Proportioned:
    """A probe of the exemplars of a kit, with all of their parts; what is random depends on the kit alone."""
    config = ProportionsConfig()
    stands = Requirements(stable=True)
    stable = all(unmet(stands, kit_shape(kit, each.whole)) is None for each in kit.exemplars)
    require = stands if stable else Requirements()
    tried = held = 0
    found: list[Shape] = []
    for number, exemplar in enumerate(kit.exemplars):
        lattice = lattice_of(kit, exemplar.whole)
        kept: list[tuple[Warp, Shape]] = []
        for place in range(-(-TRIES // len(kit.exemplars))):
            rng = decision_rng(0, "choices", "proportions", number, place)
            warp = lattice.draw(rng, config.spread, config.most)
            shape = warped(kit, exemplar.whole, lattice, warp)
            tried += 1
            if warp_fault(kit, exemplar.whole, shape) is None and unmet(require, shape) is None:
                kept.append((warp, shape))
        held += len(kept)
        points = np.array([lattice.signature(warp) for warp, _ in kept])
        origin = lattice.signature([np.ones(len(each)) for each in lattice.lengths])
        most = len(range(number, shown, len(kit.exemplars)))
        found += [kept[place][1] for place in farthest_first(points, origin, most, config.apart)]
    return Proportioned(held / max(tried, 1), found, stable)
