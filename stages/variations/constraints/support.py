"""Support: what stood on the ground or on another part in the exemplars still does (substructures §5.3).

The paper fits a plane to each contact area and tests whether its normal is vertical. Parts are upright here and are
stretched only vertically. So a part is supported where its lowest point is as high as a neighbour's highest point, and
its height is that of its lowest point above that of the shape. A repair makes a leg that hangs above the ground longer
(figure 11).
"""

from __future__ import annotations

import numpy as np

from stages.shape.kit import Assembly, Kit
from stages.variations.constraint import GlobalConstraint, Labels, Repair, Test
from stages.variations.requirements.resizing import Resizer, spans_of
from stages.variations.substitution.ground import GroundTest


def _test(kit: Kit, labels: Labels) -> Test:
    del labels
    ground = GroundTest(kit, kit.contact_tolerance)
    always = np.ones(len(kit.types), dtype=bool)
    for exemplar in kit.exemplars:
        always[exemplar.assembly.types[~_supported(kit, exemplar.assembly)]] = False

    def unmet(assembly: Assembly) -> str | None:
        if ground.is_lifted(assembly.types, assembly.placements):
            return "lifted off the ground"
        hangs = always[assembly.types] & ~_supported(kit, assembly)
        return "hangs without support" if hangs.any() else None

    return unmet


def _repair(kit: Kit, labels: Labels, resizer: Resizer) -> Repair:
    del labels
    ground = GroundTest(kit, kit.contact_tolerance)

    def repaired(assembly: Assembly) -> Assembly | None:
        result: Assembly | None = assembly
        spans = spans_of(kit, assembly)
        for part in ground.lifted(assembly.types, assembly.placements).tolist():
            low, high = spans[part].tolist()
            factor = (high - spans[:, 0].min()) / (high - low)
            result = None if result is None else resizer.stretched(result, part, factor, high)
        return result

    return repaired


def _supported(kit: Kit, assembly: Assembly) -> np.ndarray:
    """Return which parts stand on the ground or on the top of a neighbour, bool (n,)."""
    heights = spans_of(kit, assembly)
    tolerance = 2 * kit.contact_tolerance
    supported: np.ndarray = heights[:, 0] <= heights[:, 0].min() + tolerance
    for i, j in assembly.edges.tolist():
        for upper, lower in ((i, j), (j, i)):
            supported[upper] |= abs(heights[upper, 0] - heights[lower, 1]) <= tolerance
    return supported


CONSTRAINT = GlobalConstraint(needs=(), may=(), test=_test, repair=_repair)
