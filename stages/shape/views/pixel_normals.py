"""Smooth normals of pixels: corner normals interpolated over each triangle, so that a facetted surface looks round.

Numba compiles this module when it is imported: import it inside functions.
"""

from __future__ import annotations

import numba
import numpy as np

from stages.shape.arrays import Float32Array, FloatArray
from stages.shape.views.buffers import Visible


def smooth_normals(seen: Visible, rotations: FloatArray | None = None) -> Float32Array:
    """Return the unit normal of each pixel in eye space, float32 (h, w, 3), zero for background.

    rotations: of each part to eye space, float64 (n, 3, 3); by default a product whose digits depend on the machine

    A normal points towards the viewer, as those of the flat faces do.
    """
    scene = seen.scene
    if rotations is None:
        rotations = (seen.view.eye @ scene.poses)[:, :3, :3]
    parts, faces = scene.triangle_part, scene.triangle_face
    normals: Float32Array = _interpolate(
        seen.triangles, seen.screen, seen.normals, scene.meshes.corner_normals, parts, faces, rotations
    )
    return normals


@numba.njit(cache=True, error_model="numpy")
def _interpolate(triangles, screen, flat, corners, parts, face_of, rotations):
    height, width = triangles.shape
    normals = np.zeros((height, width, 3), np.float32)
    for row in range(height):
        for column in range(width):
            t = triangles[row, column]
            if t < 0:
                continue
            s, n, r = screen[t], corners[face_of[t]], rotations[parts[t]]
            ax, ay, bx, by = s[1, 0] - s[0, 0], s[1, 1] - s[0, 1], s[2, 0] - s[0, 0], s[2, 1] - s[0, 1]
            px, py = column + 0.5 - s[0, 0], row + 0.5 - s[0, 1]
            area = ax * by - ay * bx
            u = min(max((px * by - py * bx) / area, 0.0), 1.0) if area != 0.0 else 0.0
            v = min(max((ax * py - ay * px) / area, 0.0), 1.0 - u) if area != 0.0 else 0.0
            w = 1.0 - u - v
            x = w * n[0, 0] + u * n[1, 0] + v * n[2, 0]
            y = w * n[0, 1] + u * n[1, 1] + v * n[2, 1]
            z = w * n[0, 2] + u * n[1, 2] + v * n[2, 2]
            nx = r[0, 0] * x + r[0, 1] * y + r[0, 2] * z
            ny = r[1, 0] * x + r[1, 1] * y + r[1, 2] * z
            nz = r[2, 0] * x + r[2, 1] * y + r[2, 2] * z
            length = np.sqrt(nx * nx + ny * ny + nz * nz)
            if length > 0.0:
                if nx * flat[t, 0] + ny * flat[t, 1] + nz * flat[t, 2] < 0.0:
                    length = -length
                normals[row, column, 0], normals[row, column, 1] = nx / length, ny / length
                normals[row, column, 2] = nz / length
    return normals
