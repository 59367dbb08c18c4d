"""Penetration depth of one posed part in another by ray casting (Open3D): slow, and exact enough for verification."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.geometry.pose import invert, transform_points
from stages.shape.kit import PartMesh

PROBE_SPACING_SHARE = 0.04
"""Distance of the probes on a part's surface, as a share of its diagonal."""
RAYS = np.array(
    [
        [0.8018, 0.2673, 0.5345],
        [-0.6124, 0.7416, 0.2739],
        [0.1543, -0.7715, 0.6172],
        [-0.3015, -0.4523, -0.8393],
        [0.5571, 0.3714, -0.7428],
        [-0.9045, -0.3015, 0.3015],
        [0.2182, -0.8729, -0.4364],
    ]
)
"""Directions in which a probe looks for surfaces, oblique to common modelling axes."""
MAJORITY_RAYS = len(RAYS) // 2 + 1
BOX_ROUNDING_SHARE = 1e-9
"""Points this near to a box, as a share of its size, are tested again with exact coordinates."""

MAX_SCENES = 200
"""Ray-casting scenes that a PenetrationTest keeps. Open3D 0.20 crashes where a process has over a thousand."""


def depth_bound(first: FloatArray, second: FloatArray) -> float:
    """Return an upper bound of the penetration depth of parts in two boxes (2, 3).

    The bound is the least overlap of the boxes among the axes along which neither contains the other, infinite if there
    is no such axis.
    """
    overlap = np.minimum(first[1], second[1]) - np.maximum(first[0], second[0])
    nested = (first[0] - second[0]) * (first[1] - second[1]) <= 0
    return float(np.where(nested & (overlap > 0), np.inf, overlap).min())


class PenetrationTest:
    """Penetration depth of posed parts of given types."""

    def __init__(self, types: Sequence[PartMesh]) -> None:
        self.types = tuple(types)
        self._scenes: dict[int, Any] = {}
        self._probes: dict[int, FloatArray] = {}
        self._centres: dict[int, FloatArray] = {}

    def depth(self, a: int, b: int, pose: FloatArray, apart: bool = False) -> float:
        """Return how far a part of type `b` at `pose` (4, 4) in coordinates of one of type `a` and that part penetrate.

        The depth is the greatest distance to the other's surface of a point inside the other. Points sample both
        surfaces regularly. The majority of several rays decides what is inside, so a mesh with holes has an inside
        where most rays see one.

        apart: whether their surfaces are known not to meet. Then each triangle is inside or outside as a whole, so one
            point of each decides whether there is any depth.
        """
        if apart and not self._holds_any(a, b, pose) and not self._holds_any(b, a, invert(pose)):
            return 0.0
        return max(self._depth_of(a, b, pose), self._depth_of(b, a, invert(pose)))

    def _depth_of(self, index: int, other: int, pose: FloatArray) -> float:
        """Return how deep points of a part of type `other` at `pose` lie in one of type `index`."""
        import open3d as o3d

        near = _inside_box(self._points(other), pose, self.types[index].bounds).astype(np.float32)
        inside = self._inside(index, near)
        if not inside.any():
            return 0.0
        distances = self._scene(index).compute_distance(o3d.core.Tensor(near[inside]), nthreads=1).numpy()
        return float(distances.max())

    def _holds_any(self, index: int, other: int, pose: FloatArray) -> bool:
        """Return whether the middle of any triangle of a part of type `other` at `pose` lies in one of type `index`."""
        near = _inside_box(self._middles(other), pose, self.types[index].bounds).astype(np.float32)
        return bool(self._inside(index, near).any())

    def _inside(self, index: int, points: np.ndarray) -> np.ndarray:
        """Return which of the points, float32 (p, 3), lie in a part of type `index`, bool (p,)."""
        if len(points) == 0:
            return np.zeros(0, dtype=bool)
        scene = self._scene(index)
        # Four of seven are a majority: only points on which the first four disagree need the others.
        odd = self._odd(scene, points, RAYS[:MAJORITY_RAYS])
        doubtful = (odd > 0) & (odd < MAJORITY_RAYS)
        odd[doubtful] += self._odd(scene, points[doubtful], RAYS[MAJORITY_RAYS:])
        is_inside: np.ndarray = odd >= MAJORITY_RAYS
        return is_inside

    def _odd(self, scene: Any, points: np.ndarray, directions: FloatArray) -> np.ndarray:
        """Return along how many `directions` (d, 3) each of the points (p, 3) sees an odd number of surfaces, (p,)."""
        import open3d as o3d

        turned = np.tile(directions, (len(points), 1))
        rays = np.concatenate([np.repeat(points, len(directions), axis=0), turned], axis=1).astype(np.float32)
        hits = scene.count_intersections(o3d.core.Tensor(rays), nthreads=1).numpy()
        odd: np.ndarray = (hits.reshape(-1, len(directions)) % 2).sum(axis=1)
        return odd

    def _scene(self, index: int) -> Any:
        import open3d as o3d

        if index not in self._scenes:
            if len(self._scenes) == MAX_SCENES:
                del self._scenes[next(iter(self._scenes))]  # the oldest
            scene = o3d.t.geometry.RaycastingScene(nthreads=1)
            part = self.types[index]
            scene.add_triangles(
                o3d.core.Tensor(part.vertices.astype(np.float32)), o3d.core.Tensor(part.faces.astype(np.uint32))
            )
            self._scenes[index] = scene
        return self._scenes[index]

    def _middles(self, index: int) -> FloatArray:
        """Return the middles of the triangles of a type in columns, float64 (3, f)."""
        if index not in self._centres:
            part = self.types[index]
            self._centres[index] = np.ascontiguousarray(part.vertices[part.faces].mean(axis=1).T)
        return self._centres[index]

    def _points(self, index: int) -> FloatArray:
        """Return the probes of a type in columns, float64 (3, p)."""
        if index not in self._probes:
            part = self.types[index]
            corners = part.vertices[part.faces]
            longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
            steps = np.clip(np.ceil(longest / (PROBE_SPACING_SHARE * part.diagonal)), 1, 12).astype(int)
            points = [part.vertices]
            for count in np.unique(steps):
                weights = [(i, j, count - i - j) for i in range(count + 1) for j in range(count + 1 - i)]
                barycentric = (np.array(weights) + 1 / 3) / (count + 1)
                points.append(np.einsum("kc,fcd->fkd", barycentric, corners[steps == count]).reshape(-1, 3))
            self._probes[index] = np.ascontiguousarray(np.concatenate(points).T)
        return self._probes[index]


class DepthMemory:
    """Penetration depths of posed parts of given types, each measured once; observations of the same parts share it."""

    def __init__(self, types: Sequence[PartMesh]) -> None:
        self._test = PenetrationTest(types)
        self._indices = {part: index for index, part in enumerate(self._test.types)}
        self._depths: dict[tuple[int, int, bytes], float] = {}

    def depth(self, first: PartMesh, second: PartMesh, pose: FloatArray) -> float:
        """Return how far a part of the second type at `pose` (4, 4) in coordinates of one of the first type and that
        part penetrate."""
        a, b = self._indices[first], self._indices[second]
        key = a, b, pose.tobytes()
        if key not in self._depths:
            self._depths[key] = self._test.depth(a, b, pose)
        return self._depths[key]


def _inside_box(columns: FloatArray, pose: FloatArray, box: FloatArray) -> FloatArray:
    """Return the points `columns` (3, p) that lie in a `box` (2, 3) once moved by `pose`, float64 (k, 3).

    Axes are tested one at a time: a large part has hundreds of thousands of points, and few are near.
    """
    slack = BOX_ROUNDING_SHARE * float(np.abs(box).max())
    for axis, (low, high) in enumerate(box.T):
        coordinates = pose[axis, :3] @ columns + pose[axis, 3]
        columns = columns[:, (coordinates > low - slack) & (coordinates < high + slack)]
    points = transform_points(pose, columns.T)
    inside = (points > box[0]) & (points < box[1])
    kept: FloatArray = points[inside[:, 0] & inside[:, 1] & inside[:, 2]]
    return kept
