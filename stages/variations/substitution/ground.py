"""Ground test: what always stood on the ground still does (substructures §5.3, lifted ground nodes)."""

from __future__ import annotations

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.kit import Kit


class GroundTest:
    """Finds parts above the ground whose type always stood on it in the exemplars, such as a short leg among long ones.

    tolerance: height above the lowest point of a shape up to which its ground reaches, in kit units
    """

    def __init__(self, kit: Kit, tolerance: float) -> None:
        self.tolerance = tolerance
        self._up = {"y": 1, "z": 2}[kit.up]
        self._vertices = [part_type.vertices for part_type in kit.types]
        grounded = np.ones(len(kit.types), dtype=bool)
        for exemplar in kit.exemplars:
            types, poses = exemplar.assembly.types, exemplar.assembly.poses
            bottoms = self._bottoms(types, poses)
            grounded[types[bottoms > bottoms.min() + tolerance]] = False
        self._grounded = grounded

    def is_lifted(self, types: np.ndarray, poses: FloatArray) -> bool:
        """Return whether a part of types int (n,) at placements (n, 4, 4) is off the ground and never was before."""
        return bool(len(self.lifted(types, poses)))

    def lifted(self, types: np.ndarray, poses: FloatArray) -> np.ndarray:
        """Return the parts that are, int64 (k,)."""
        bottoms = self._bottoms(types, poses)
        return np.flatnonzero(self._grounded[types] & (bottoms > bottoms.min() + self.tolerance))

    def _bottoms(self, types: np.ndarray, poses: FloatArray) -> FloatArray:
        """Return the height of each part's lowest point, float64 (n,)."""
        lowest = [
            (self._vertices[part_type] @ pose[self._up, :3]).min() + pose[self._up, 3]
            for part_type, pose in zip(types.tolist(), poses, strict=True)
        ]
        return np.array(lowest)
