"""Rays and nearest points on the triangles of a shape, by Embree in Open3D: no display, no driver, one thread."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from stages.shape.arrays import BoolArray, FloatArray, IntArray
from stages.shape.geometry.pose import transform_points
from stages.shape.shape import Shape


class RayCaster:
    """Ray queries on a shape. Open3D uses 32-bit numbers, so coordinates are relative to the middle of the shape."""

    def __init__(self, shape: Shape) -> None:
        self._shape = shape

    @cached_property
    def triangles(self) -> tuple[FloatArray, IntArray]:
        """Corners of all triangles, float64 (t, 3, 3), and the part of each, int32 (t,)."""
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

    def hit(
        self, origins: FloatArray, directions: FloatArray, nearest: float = 0.0, farthest: float = np.inf
    ) -> BoolArray:
        """Return which rays hit the shape, bool (n,).

        origins, directions: float64 (n, 3)
        nearest, farthest: limits of the hit, in lengths of the directions
        """
        scene, middle = self._scene
        rays = np.concatenate([origins - middle, directions], axis=1).astype(np.float32)
        hits: BoolArray = scene.test_occlusions(_tensor(rays), tnear=nearest, tfar=farthest, nthreads=1).numpy()
        return hits

    def first_hits(self, origins: FloatArray, directions: FloatArray) -> tuple[FloatArray, IntArray]:
        """Return what rays hit first: the distance in lengths of the directions, float64 (n,), infinite for nothing,
        and the triangle, int32 (n,), -1 for nothing.

        origins, directions: float64 (n, 3)
        """
        scene, middle = self._scene
        rays = np.concatenate([origins - middle, directions], axis=1).astype(np.float32)
        hits = scene.cast_rays(_tensor(rays), nthreads=1)
        distances = hits["t_hit"].numpy().astype(np.float64)
        triangles = hits["primitive_ids"].numpy().astype(np.int64)
        return distances, np.where(np.isfinite(distances), triangles, -1).astype(np.int32)

    def nearest(self, points: FloatArray) -> tuple[IntArray, FloatArray]:
        """Return the nearest triangle of each point, int32 (n,), and its distance, float64 (n,)."""
        scene, middle = self._scene
        closest = scene.compute_closest_points(_tensor((points - middle).astype(np.float32)), nthreads=1)
        gaps = np.linalg.norm(closest["points"].numpy().astype(np.float64) - (points - middle), axis=1)
        return closest["primitive_ids"].numpy().astype(np.int32), gaps

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
