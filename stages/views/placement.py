"""Where the triangles of a scene lie, computed in a fixed order, so that every machine gets the same digits.

Numba compiles this module when it is imported: import it inside functions.
"""

from __future__ import annotations

import numba
import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.views.camera import View
from stages.shape.views.layers import LAYER_STEP
from stages.shape.views.scene import Scene
from stages.views.cameras import Sphere


def bounding_sphere(scene: Scene) -> Sphere:
    """Return the sphere around the middle of the bounding box that holds all vertices of a scene."""
    meshes = scene.meshes
    moves = moves_to_eye(scene, np.eye(4))
    middle, radius = _sphere(meshes.vertices, meshes.vertex_first, scene.mesh_of, moves)
    return Sphere(middle, float(radius) or 1.0)


def moves_to_eye(scene: Scene, eye: FloatArray) -> FloatArray:
    """Return transforms from the mesh coordinates of each part to eye space, float64 (n, 4, 4).

    eye: rigid transform from the world to eye space, (4, 4)
    """
    moves: FloatArray = _moves(eye, scene.poses, scene.meshes.centers, scene.mesh_of)
    return moves


def set_back(scene: Scene, view: View, moves: FloatArray) -> FloatArray:
    """Return the transforms with parts set back by layer: of two faces in one plane, that of the lower layer is seen.

    As `stages.shape.views.layers` does for the other pictures.
    """
    back = LAYER_STEP * view.radius * scene.layers
    moved = moves.copy()
    if view.perspective:
        moved[:, :3] *= (1.0 + back / view.depth)[:, None, None]
    else:
        moved[:, 2, 3] -= back
    return moved


@numba.njit(cache=True, error_model="numpy")
def _moves(eye, poses, centers, mesh_of):
    moves = np.zeros((len(poses), 4, 4))
    for part in range(len(poses)):
        pose, center = poses[part], centers[mesh_of[part]]
        place = np.empty(3)
        for k in range(3):
            place[k] = pose[k, 0] * center[0] + pose[k, 1] * center[1] + pose[k, 2] * center[2] + pose[k, 3]
        for i in range(3):
            for j in range(3):
                moves[part, i, j] = eye[i, 0] * pose[0, j] + eye[i, 1] * pose[1, j] + eye[i, 2] * pose[2, j]
            moves[part, i, 3] = eye[i, 0] * place[0] + eye[i, 1] * place[1] + eye[i, 2] * place[2] + eye[i, 3]
        moves[part, 3, 3] = 1.0
    return moves


@numba.njit(cache=True, error_model="numpy")
def _sphere(vertices, vertex_first, mesh_of, moves):
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    middle, farthest = np.zeros(3), 0.0
    for turn in range(2):
        for part in range(len(mesh_of)):
            m = moves[part]
            for vertex in range(vertex_first[mesh_of[part]], vertex_first[mesh_of[part] + 1]):
                v = vertices[vertex]
                distance = 0.0
                for k in range(3):
                    x = m[k, 0] * v[0] + m[k, 1] * v[1] + m[k, 2] * v[2] + m[k, 3]
                    if turn == 0:
                        low[k], high[k] = min(low[k], x), max(high[k], x)
                    distance += (x - middle[k]) * (x - middle[k])
                farthest = max(farthest, distance)
        if turn == 0:
            middle, farthest = (low + high) / 2.0, 0.0
    return middle, np.sqrt(farthest)
