"""What the pixels of a view show: triangles on the screen, and depth, normal, part and colour of the seen points.

Both renderers only return the triangle of each pixel. The rest is computed here from that triangle's plane, in double
precision. So two renderers that see the same triangles give the same buffers.

Screen coordinates are pixels, x to the right and y down, the centre of the first pixel at (0.5, 0.5). The third
coordinate is clip depth, which is linear across the screen on every plane.
"""

from __future__ import annotations

import numba
import numpy as np

from stages.shape.arrays import ByteArray, Float32Array, FloatArray, IntArray
from stages.shape.views.camera import View
from stages.shape.views.scene import Scene


def screen_triangles(scene: Scene, view: View, width: int, height: int) -> FloatArray:
    """Return the corners of all triangles on the screen, float64 (t, 3, 3)."""
    return project_triangles(scene, view, view.eye @ scene.placed, width, height)


def project_triangles(scene: Scene, view: View, moves: FloatArray, width: int, height: int) -> FloatArray:
    """Return the corners of all triangles on the screen, float64 (t, 3, 3).

    moves: transforms from the mesh coordinates of each part to eye space, float64 (n, 4, 4)
    """
    parts, faces = scene.triangle_part, scene.triangle_face
    screen: FloatArray = _project(
        scene.meshes.vertices, scene.meshes.faces, parts, faces, moves, view.projection, width, height
    )
    return screen


def screen_normals(scene: Scene, view: View, screen: FloatArray) -> FloatArray:
    """Return unit normals of all triangles in eye space, turned towards the viewer, float64 (t, 3)."""
    return facing_normals(scene, (view.eye @ scene.poses)[:, :3, :3], screen)


def facing_normals(scene: Scene, rotations: FloatArray, screen: FloatArray) -> FloatArray:
    """Return unit normals of all triangles in eye space, turned towards the viewer, float64 (t, 3).

    rotations: from the mesh coordinates of each part to eye space, float64 (n, 3, 3)
    """
    parts, faces = scene.triangle_part, scene.triangle_face
    normals: FloatArray = _facing_normals(scene.meshes.normals, parts, faces, rotations, screen)
    return normals


def surface_buffers(
    scene: Scene, view: View, triangles: IntArray, screen: FloatArray, normals: FloatArray
) -> tuple[Float32Array, Float32Array, IntArray, ByteArray]:
    """Return depth float32 (h, w), normal float32 (h, w, 3), part int32 (h, w) and colour uint8 (h, w, 3) of the
    pixels.

    triangles: triangle of each pixel, int32 (h, w); where it is -1, depth is infinite, the normal zero, the part -1 and
        the colour white
    """
    parts, faces, colors = scene.triangle_part, scene.triangle_face, scene.meshes.colors
    shaded: tuple[Float32Array, Float32Array, IntArray, ByteArray] = _shade(
        triangles, screen, normals, parts, faces, colors, view.projection
    )
    return shaded


@numba.njit(cache=True, error_model="numpy")
def _project(vertices, faces, parts, face_of, moves, projection, width, height):
    screen = np.empty((len(parts), 3, 3))
    for t in range(len(parts)):
        m = moves[parts[t]]
        for k in range(3):
            v = vertices[faces[face_of[t], k]]
            x = m[0, 0] * v[0] + m[0, 1] * v[1] + m[0, 2] * v[2] + m[0, 3]
            y = m[1, 0] * v[0] + m[1, 1] * v[1] + m[1, 2] * v[2] + m[1, 3]
            z = m[2, 0] * v[0] + m[2, 1] * v[1] + m[2, 2] * v[2] + m[2, 3]
            w = projection[3, 2] * z + projection[3, 3]
            screen[t, k, 0] = (projection[0, 0] * x / w + 1.0) * 0.5 * width
            screen[t, k, 1] = (1.0 - projection[1, 1] * y / w) * 0.5 * height
            screen[t, k, 2] = (projection[2, 2] * z + projection[2, 3]) / w
    return screen


@numba.njit(cache=True, error_model="numpy")
def _facing_normals(mesh_normals, parts, face_of, rotations, screen):
    normals = np.empty((len(parts), 3))
    for t in range(len(parts)):
        n, r, s = mesh_normals[face_of[t]], rotations[parts[t]], screen[t]
        area = (s[1, 0] - s[0, 0]) * (s[2, 1] - s[0, 1]) - (s[1, 1] - s[0, 1]) * (s[2, 0] - s[0, 0])
        # Counter-clockwise seen from in front; y points down on the screen, which turns the sign.
        sign = -1.0 if area > 0.0 else 1.0
        for k in range(3):
            normals[t, k] = sign * (r[k, 0] * n[0] + r[k, 1] * n[1] + r[k, 2] * n[2])
    return normals


@numba.njit(cache=True, error_model="numpy")
def clip_at(screen, t, x, y):
    """Return the clip depth of the plane of triangle `t` at a point of the screen, clamped to the triangle's depths."""
    ax, ay = screen[t, 1, 0] - screen[t, 0, 0], screen[t, 1, 1] - screen[t, 0, 1]
    bx, by = screen[t, 2, 0] - screen[t, 0, 0], screen[t, 2, 1] - screen[t, 0, 1]
    first, second, third = screen[t, 0, 2], screen[t, 1, 2], screen[t, 2, 2]
    low = min(first, second, third)
    area = ax * by - ay * bx
    if area == 0.0:
        return low
    px, py = x - screen[t, 0, 0], y - screen[t, 0, 1]
    u, v = (px * by - py * bx) / area, (ax * py - ay * px) / area
    depth = first + u * (second - first) + v * (third - first)
    return min(max(depth, low), max(first, second, third))


@numba.njit(cache=True, error_model="numpy")
def eye_depth(clip, projection):
    """Return the distance along the viewing axis of a clip depth."""
    return -(projection[2, 3] - clip * projection[3, 3]) / (clip * projection[3, 2] - projection[2, 2])


@numba.njit(cache=True, error_model="numpy")
def _shade(triangles, screen, normals, parts, face_of, colors, projection):
    height, width = triangles.shape
    depth = np.full((height, width), np.inf, dtype=np.float32)
    normal = np.zeros((height, width, 3), dtype=np.float32)
    part = np.full((height, width), -1, dtype=np.int32)
    color = np.full((height, width, 3), 255, dtype=np.uint8)
    for row in range(height):
        for column in range(width):
            t = triangles[row, column]
            if t < 0:
                continue
            depth[row, column] = eye_depth(clip_at(screen, t, column + 0.5, row + 0.5), projection)
            part[row, column] = parts[t]
            for k in range(3):
                normal[row, column, k] = normals[t, k]
                color[row, column, k] = colors[face_of[t], k]
    return depth, normal, part, color
