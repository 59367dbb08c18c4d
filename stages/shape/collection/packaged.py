"""A finished sample as `make verify` reads it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from stages.shape.arrays import FloatArray, IntArray
from stages.shape.collection.pairs import CONTACTS, pairs_of
from stages.shape.geometry.bounds import shape_bounds
from stages.shape.shape import Shape

__all__ = ["Packaged"]


@dataclass(frozen=True)
class Packaged:
    """One sample of a finished dataset.

    record: its `json`; members: its files by what stands after the key; arrays: the `.npy` ones among them.
    shape: what its record says that it is, made anew from its source, in the coordinates of the dataset.
    sections: the config that the dataset was made with, as the manifest has it.
    """

    key: str
    record: Mapping[str, Any]
    members: Mapping[str, bytes]
    arrays: Mapping[str, np.ndarray]
    shape: Shape
    sections: Mapping[str, Any]

    @cached_property
    def contacts(self) -> IntArray:
        """The pairs of parts that touch, int32 (m, 2), as recorded."""
        return pairs_of(self.members[CONTACTS])

    @cached_property
    def size(self) -> float:
        """The longest side of the box around the shape, in its units."""
        bounds = shape_bounds(self.shape)
        return float((bounds[1] - bounds[0]).max())

    def hit(self, origins: FloatArray, directions: FloatArray) -> npt.NDArray[np.bool_]:
        """Which rays, float64 (n, 3), meet the shape."""
        casting, middle = self._casting
        rays = np.concatenate([origins - middle, directions], axis=1).astype(np.float32)
        distances = casting.cast_rays(_tensor(rays), nthreads=1)["t_hit"].numpy()
        found: npt.NDArray[np.bool_] = np.isfinite(distances)
        return found

    def nearest(self, points: FloatArray) -> tuple[IntArray, FloatArray]:
        """The nearest of `triangles` of each point, int32 (n,), and how far it is, float64 (n,)."""
        casting, middle = self._casting
        found = casting.compute_closest_points(_tensor((points - middle).astype(np.float32)), nthreads=1)
        gaps = np.linalg.norm(found["points"].numpy().astype(np.float64) - (points - middle), axis=1)
        return found["primitive_ids"].numpy().astype(np.int32), gaps

    @cached_property
    def _casting(self) -> tuple[Any, FloatArray]:
        """The shape as Open3D casts rays at it, about its middle: it counts in 32-bit numbers."""
        import open3d as o3d

        corners = self.triangles[0].reshape(-1, 3)
        middle = corners.mean(axis=0)
        casting = o3d.t.geometry.RaycastingScene(nthreads=1)
        numbers = np.arange(len(corners), dtype=np.uint32).reshape(-1, 3)
        casting.add_triangles(_tensor((corners - middle).astype(np.float32)), _tensor(numbers))
        return casting, middle

    @cached_property
    def triangles(self) -> tuple[FloatArray, IntArray]:
        """Corners of all triangles, float64 (t, 3, 3), and the part that each belongs to, int32 (t,)."""
        assembly, meshes = self.shape.assembly, self.shape.meshes
        corners, parts = [], []
        for part, (kind, pose) in enumerate(zip(assembly.types.tolist(), assembly.poses, strict=True)):
            mesh = meshes[kind]
            placed = mesh.vertices @ pose[:3, :3].T + pose[:3, 3]
            corners.append(placed[mesh.faces])
            parts.append(np.full(len(mesh.faces), part, dtype=np.int32))
        return np.concatenate(corners), np.concatenate(parts)


def _tensor(array: np.ndarray) -> Any:
    import open3d as o3d

    return o3d.core.Tensor.from_numpy(np.ascontiguousarray(array))
