"""Support: what stood on the ground or on another part in the exemplars does so still (substructures §5.3).

The paper fits a plane to each contact area and asks whether its normal is vertical. Parts are rigid here and upright,
so a part is borne where its lowest point is as high as the highest point of a neighbour, and a height is that of
its lowest point over that of the shape.
"""

from __future__ import annotations

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.kit import Assembly, Kit
from stages.variations.constraint import Constraint, Labels, Test
from stages.variations.substitution.ground import GroundTest

__all__ = ["CONSTRAINT"]


def _test(kit: Kit, labels: Labels) -> Test:
    del labels
    ground = GroundTest(kit, kit.contact_tolerance)
    spans = _Spans(kit)
    always = np.ones(len(kit.types), dtype=bool)
    for each in kit.exemplars:
        always[each.assembly.types[~spans.supported(each.assembly)]] = False

    def unmet(assembly: Assembly) -> str | None:
        if ground.is_lifted(assembly.types, assembly.poses):
            return "lifted off the ground"
        hangs = always[assembly.types] & ~spans.supported(assembly)
        return "hangs without support" if hangs.any() else None

    return unmet


class _Spans:
    """How high the parts of a kit reach."""

    def __init__(self, kit: Kit) -> None:
        self._kit, self._up = kit, {"y": 1, "z": 2}[kit.up]

    def supported(self, assembly: Assembly) -> np.ndarray:
        """Which parts stand on the ground or on the top of a neighbour, bool (n,)."""
        heights = self._of(assembly)
        tolerance = 2 * self._kit.contact_tolerance
        found: np.ndarray = heights[:, 0] <= heights[:, 0].min() + tolerance
        for i, j in assembly.edges.tolist():
            for upper, lower in ((i, j), (j, i)):
                found[upper] |= abs(heights[upper, 0] - heights[lower, 1]) <= tolerance
        return found

    def _of(self, assembly: Assembly) -> FloatArray:
        """The lowest and the highest point of each part, float64 (n, 2)."""
        spans = []
        for part_type, pose in zip(assembly.types.tolist(), assembly.poses, strict=True):
            heights = self._kit.types[part_type].vertices @ pose[self._up, :3] + pose[self._up, 3]
            spans.append((heights.min(), heights.max()))
        return np.array(spans)


CONSTRAINT = Constraint(needs=(), may=(), test=_test)
