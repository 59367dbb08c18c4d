"""Whether a motion moves one piece of a surface onto another."""

from __future__ import annotations

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.geometry.pose import invert
from stages.symmetry.surface.soup import Soup

DUST = 1e-3
"""Share of their surface by which pieces that are equal may differ: slivers where borders of cells meet old seams."""
INSIDE = 0.8
"""Points that are compared lie so far from the middle of a triangle to its corners."""


def soups_match(one: Soup, other: Soup, pose: FloatArray, tolerance: float, share: float = DUST) -> bool:
    """Whether `pose` (4, 4) moves one surface onto another: by their areas, which may differ by `share`, and by points
    of all triangles but the smallest, dust of about this share of the surface, within twice the tolerance."""
    from stages.shape.geometry.mesh_pairs import build_tree, points_on_surface

    if abs(one.area - other.area) > share * one.area:
        return False
    for source, target, way in ((one, other, pose), (other, one, invert(pose))):
        order = np.argsort(source.areas, kind="stable")
        large = source.corners[order[np.cumsum(source.areas[order]) > share * source.area]]
        middles = large.mean(axis=1, keepdims=True)
        probes = np.concatenate([middles, middles + INSIDE * (large - middles)], axis=1).reshape(-1, 3)
        tree = build_tree(target.corners.reshape(-1, 3), np.arange(3 * len(target)).reshape(-1, 3).astype(np.int32))
        if not points_on_surface(*tree, probes @ way[:3, :3].T + way[:3, 3], 2 * tolerance):
            return False
    return True
