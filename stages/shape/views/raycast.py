"""Which triangle each pixel shows, by Open3D's ray casting: no display, no driver, no OpenGL context."""

from __future__ import annotations

from functools import lru_cache
from importlib.metadata import version
from typing import Any

import numba
import numpy as np

from stages.shape.arrays import Float32Array, IntArray
from stages.shape.views.camera import View
from stages.shape.views.layers import layered_moves
from stages.shape.views.scene import Scene

__all__ = ["RaycastRenderer"]


class RaycastRenderer:
    """Casts one ray through each pixel centre, in eye space, on one thread."""

    @property
    def name(self) -> str:
        """Who casts the rays."""
        return f"Embree in Open3D {version('open3d')}"

    def triangles(self, scene: Scene, view: View, width: int, height: int) -> IntArray:
        """The triangle that each pixel shows, int32 (height, width), -1 for none."""
        import open3d as o3d

        corners = _eye_corners(
            scene.meshes.vertices,
            scene.meshes.faces,
            scene.triangle_part,
            scene.triangle_face,
            layered_moves(scene, view),
        )
        casting = o3d.t.geometry.RaycastingScene(nthreads=1)
        numbers = np.arange(len(corners) * 3, dtype=np.uint32).reshape(-1, 3)
        casting.add_triangles(o3d.core.Tensor.from_numpy(corners.reshape(-1, 3)), o3d.core.Tensor.from_numpy(numbers))
        rays = _rays(view.projection.tobytes(), width, height)
        hits = casting.cast_rays(rays, nthreads=1)["primitive_ids"].numpy().astype(np.uint32)
        return np.where(hits == casting.INVALID_ID, -1, hits.astype(np.int64)).astype(np.int32)

    def close(self) -> None:
        """Nothing is held."""


@numba.njit(cache=True)
def _eye_corners(vertices, faces, parts, face_of, moves):
    """Triangle corners in eye space, float32 (t, 3, 3)."""
    corners = np.empty((len(parts), 3, 3), dtype=np.float32)
    for t in range(len(parts)):
        m = moves[parts[t]]
        for k in range(3):
            v = vertices[faces[face_of[t], k]]
            for axis in range(3):
                corners[t, k, axis] = m[axis, 0] * v[0] + m[axis, 1] * v[1] + m[axis, 2] * v[2] + m[axis, 3]
    return corners


@lru_cache(maxsize=8)
def _rays(projection: bytes, width: int, height: int) -> Any:
    """Rays through the pixel centres as an Open3D tensor float32 (height, width, 6)."""
    import open3d as o3d

    matrix = np.frombuffer(projection).reshape(4, 4)
    x = ((np.arange(width) + 0.5) * 2 / width - 1) / matrix[0, 0]
    y = (1 - (np.arange(height) + 0.5) * 2 / height) / matrix[1, 1]
    rays: Float32Array = np.zeros((height, width, 6), dtype=np.float32)
    start = 3 if matrix[3, 3] == 0.0 else 0
    rays[..., 5] = -1.0
    rays[..., start], rays[..., start + 1] = x[None, :], y[:, None]
    return o3d.core.Tensor.from_numpy(rays)
