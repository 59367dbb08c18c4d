"""Rays and nearest points at all triangles of a shape, by Embree in Open3D: no display, no driver, one thread."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from stages.shape.arrays import BoolArray, FloatArray, IntArray
from stages.shape.geometry.pose import transform_points
from stages.shape.shape import Shape


class RayCaster:
    """A shape as rays see it. Open3D counts in 32-bit numbers, so it is cast about the shape's middle."""

    def __init__(self, shape: Shape) -> None:
        self._shape = shape

    @cached_property
    def triangles(self) -> tuple[FloatArray, IntArray]:
        """Corners of all triangles, float64 (t, 3, 3), and the part that each belongs to, int32 (t,)."""
        assembly, meshes = self._shape.assembly, self._shape.meshes
        corners, parts = [], []
        for part, (kind, pose) in enumerate(zip(assembly.types.tolist(), assembly.poses, strict=True)):
            mesh = meshes[kind]
            corners.append(transform_points(pose, mesh.vertices)[mesh.faces])
            parts.append(np.full(len(mesh.faces), part, dtype=np.int32))
        return np.concatenate(corners), np.concatenate(parts)

    @cached_property
    def size(self) -> float:
        """The longest side of the box around all triangles."""
        return float(np.ptp(self.triangles[0].reshape(-1, 3), axis=0).max())

    def hit(self, origins: FloatArray, directions: FloatArray, least: float = 0.0, most: float = np.inf) -> BoolArray:
        """Which rays, float64 (n, 3), meet the shape between `least` and `most` lengths of their directions."""
        scene, middle = self._scene
        rays = np.concatenate([origins - middle, directions], axis=1).astype(np.float32)
        found: BoolArray = scene.test_occlusions(_tensor(rays), tnear=least, tfar=most, nthreads=1).numpy()
        return found

    def nearest(self, points: FloatArray) -> tuple[IntArray, FloatArray]:
        """The nearest of `triangles` of each point, int32 (n,), and how far it is, float64 (n,)."""
        scene, middle = self._scene
        found = scene.compute_closest_points(_tensor((points - middle).astype(np.float32)), nthreads=1)
        gaps = np.linalg.norm(found["points"].numpy().astype(np.float64) - (points - middle), axis=1)
        return found["primitive_ids"].numpy().astype(np.int32), gaps

    @cached_property
    def _scene(self) -> tuple[Any, FloatArray]:
        import open3d as o3d

        corners = self.triangles[0].reshape(-1, 3)
        middle = corners.mean(axis=0)
        scene = o3d.t.geometry.RaycastingScene(nthreads=1)
        numbers = np.arange(len(corners), dtype=np.uint32).reshape(-1, 3)
        scene.add_triangles(_tensor((corners - middle).astype(np.float32)), _tensor(numbers))
        return scene, middle


def _tensor(array: np.ndarray) -> Any:
    import open3d as o3d

    return o3d.core.Tensor.from_numpy(np.ascontiguousarray(array))
