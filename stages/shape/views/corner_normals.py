"""Normals that turn smoothly from face to face: a round thing made of flat faces is shaded as the round thing.

Numba compiles this module when it is imported: import it inside functions.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from stages.shape.arrays import Float32Array, FloatArray, IntArray
from stages.shape.views.buffers import Visible

SHARP = 35.0
"""Faces around a vertex that turn by more, in degrees, keep an edge between them."""


def corner_normals(vertices: FloatArray, faces: IntArray, welded: np.ndarray, normals: FloatArray) -> Float32Array:
    """The unit normal at each corner of each face, float32 (f, 3, 3): the mean of the faces around that vertex that
    turn from this one by less than SHARP, by their areas and their angles there, so that a small bevel does not bend
    the large face beside it.

    vertices: float64 (v, 3); faces: int32 (f, 3); welded: int64 (f, 3), one number for the corners at one place;
    normals: float64 (f, 3), unit, or zero for faces without area, which count for nothing.
    """
    found: Float32Array = _corner_normals(vertices, faces, welded, normals, math.cos(math.radians(SHARP)))
    return found


def smooth_normals(seen: Visible) -> Float32Array:
    """Unit normals of the pixels in eye space, float32 (h, w, 3), towards the viewer as those of the flat faces are;
    zero for background."""
    scene = seen.scene
    rotations = (seen.view.eye @ scene.poses)[:, :3, :3]
    parts, faces = scene.triangle_part, scene.triangle_face
    found: Float32Array = _smooth(
        seen.triangles, seen.screen, seen.normals, scene.meshes.corner_normals, parts, faces, rotations
    )
    return found


@numba.njit(cache=True, error_model="numpy")
def _corner_normals(vertices, faces, welded, normals, least):
    count = len(faces)
    weights = np.zeros((count, 3))
    first = np.zeros(welded.max() + 2 if count else 1, np.int64)
    for f in range(count):
        a, b, c = vertices[faces[f, 0]], vertices[faces[f, 1]], vertices[faces[f, 2]]
        area = np.linalg.norm(np.cross(b - a, c - a))
        for k in range(3):
            here, ahead, behind = (
                vertices[faces[f, k]],
                vertices[faces[f, (k + 1) % 3]],
                vertices[faces[f, (k + 2) % 3]],
            )
            weights[f, k] = area * np.arctan2(area, np.dot(ahead - here, behind - here))
            first[welded[f, k] + 1] += 1
    first = np.cumsum(first)
    corners, filled = np.empty(3 * count, np.int64), first.copy()
    for f in range(count):
        for k in range(3):
            corners[filled[welded[f, k]]] = 3 * f + k
            filled[welded[f, k]] += 1
    found = np.zeros((count, 3, 3), np.float32)
    for f in range(count):
        own = normals[f]
        for k in range(3):
            total = np.zeros(3)
            for place in range(first[welded[f, k]], first[welded[f, k] + 1]):
                other, corner = corners[place] // 3, corners[place] % 3
                if np.dot(own, normals[other]) >= least:
                    total += weights[other, corner] * normals[other]
            length = np.linalg.norm(total)
            found[f, k] = total / length if length > 0.0 else own
    return found


@numba.njit(cache=True, error_model="numpy")
def _smooth(triangles, screen, flat, corners, parts, face_of, rotations):
    height, width = triangles.shape
    found = np.zeros((height, width, 3), np.float32)
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
            x, y, z = (1.0 - u - v) * n[0] + u * n[1] + v * n[2]
            turned = np.array([r[k, 0] * x + r[k, 1] * y + r[k, 2] * z for k in range(3)])
            length, towards = np.linalg.norm(turned), np.dot(turned, flat[t])
            if length > 0.0:
                found[row, column] = turned / (length if towards >= 0.0 else -length)
    return found
