"""Support: what stood on the ground or on another part in the exemplars does so still (substructures §5.3).

The paper fits a plane to each contact area and asks whether its normal is vertical. Parts are upright here and
stretched upright alone, so a part is borne where its lowest point is as high as the highest point of a neighbour, and a
height is that of its lowest point over that of the shape. A leg that hangs over the ground may be made taller, so that
it reaches it (figure 11).
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
    for each in kit.exemplars:
        always[each.assembly.types[~_supported(kit, each.assembly)]] = False

    def unmet(assembly: Assembly) -> str | None:
        if ground.is_lifted(assembly.types, assembly.placements):
            return "lifted off the ground"
        hangs = always[assembly.types] & ~_supported(kit, assembly)
        return "hangs without support" if hangs.any() else None

    return unmet


def _mend(kit: Kit, labels: Labels, resizer: Resizer) -> Repair:
    del labels
    ground = GroundTest(kit, kit.contact_tolerance)

    def mended(assembly: Assembly) -> Assembly | None:
        found: Assembly | None = assembly
        spans = spans_of(kit, assembly)
        for part in ground.lifted(assembly.types, assembly.placements).tolist():
            low, high = spans[part].tolist()
            factor = (high - spans[:, 0].min()) / (high - low)
            found = None if found is None else resizer.stretched(found, part, factor, high)
        return found

    return mended


def _supported(kit: Kit, assembly: Assembly) -> np.ndarray:
    """Which parts stand on the ground or on the top of a neighbour, bool (n,)."""
    heights = spans_of(kit, assembly)
    tolerance = 2 * kit.contact_tolerance
    found: np.ndarray = heights[:, 0] <= heights[:, 0].min() + tolerance
    for i, j in assembly.edges.tolist():
        for upper, lower in ((i, j), (j, i)):
            found[upper] |= abs(heights[upper, 0] - heights[lower, 1]) <= tolerance
    return found


CONSTRAINT = GlobalConstraint(needs=(), may=(), test=_test, repair=_mend)
