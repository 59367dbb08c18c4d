"""Whether a rigid transform maps one piece of a surface onto another."""

from __future__ import annotations

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.geometry.pose import invert
from stages.symmetry.surface.soup import Soup

MAX_AREA_DIFFERENCE = 1e-3
"""Share of their area by which equal pieces may differ: slivers where borders of cells meet old seams."""
PROBE_SHARE = 0.8
"""Position of the probe points on the way from the centre of a triangle to its corners."""


def soups_match(
    one: Soup, other: Soup, pose: FloatArray, tolerance: float, max_difference: float = MAX_AREA_DIFFERENCE
) -> bool:
    """Return whether `pose` (4, 4) maps one surface onto the other.

    max_difference: share of the area by which the two may differ

    The areas must agree. Probe points must lie within twice the tolerance of the other surface. The smallest triangles,
    which make up that share of the surface, have none.
    """
    from stages.shape.geometry.mesh_pairs import build_tree, points_on_surface

    if abs(one.area - other.area) > max_difference * one.area:
        return False
    for source, target, transform in ((one, other, pose), (other, one, invert(pose))):
        order = np.argsort(source.areas, kind="stable")
        large = source.corners[order[np.cumsum(source.areas[order]) > max_difference * source.area]]
        centres = large.mean(axis=1, keepdims=True)
        probes = np.concatenate([centres, centres + PROBE_SHARE * (large - centres)], axis=1).reshape(-1, 3)
        tree = build_tree(target.corners.reshape(-1, 3), np.arange(3 * len(target)).reshape(-1, 3).astype(np.int32))
        if not points_on_surface(*tree, probes @ transform[:3, :3].T + transform[:3, 3], 2 * tolerance):
            return False
    return True
