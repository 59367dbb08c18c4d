"""Support: what stood on the ground stands on it still (substructures §5.3, lifted ground nodes)."""

from __future__ import annotations

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.kit import Kit


class GroundTest:
    """Tells shapes in which a part hangs in the air that always stood on the ground in the exemplars, as a short leg
    among long ones does. `tolerance`: how far above the lowest point of a shape its ground reaches, in kit units."""

    def __init__(self, kit: Kit, tolerance: float) -> None:
        self.tolerance = tolerance
        self._up = {"y": 1, "z": 2}[kit.up]
        self._vertices = [each.vertices for each in kit.types]
        grounded = np.ones(len(kit.types), dtype=bool)
        for each in kit.exemplars:
            types, poses = each.assembly.types, each.assembly.poses
            bottoms = self._bottoms(types, poses)
            grounded[types[bottoms > bottoms.min() + tolerance]] = False
        self._grounded = grounded

    def is_lifted(self, types: np.ndarray, poses: FloatArray) -> bool:
        """Whether a part of types int (n,) at placements (n, 4, 4) is off the ground and never was before."""
        return bool(len(self.lifted(types, poses)))

    def lifted(self, types: np.ndarray, poses: FloatArray) -> np.ndarray:
        """The parts that are, int64 (k,)."""
        bottoms = self._bottoms(types, poses)
        return np.flatnonzero(self._grounded[types] & (bottoms > bottoms.min() + self.tolerance))

    def _bottoms(self, types: np.ndarray, poses: FloatArray) -> FloatArray:
        """The height of the lowest point of each part, float64 (n,)."""
        lowest = [
            (self._vertices[part_type] @ pose[self._up, :3]).min() + pose[self._up, 3]
            for part_type, pose in zip(types.tolist(), poses, strict=True)
        ]
        return np.array(lowest)
