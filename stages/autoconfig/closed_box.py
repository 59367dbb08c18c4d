"""Is a shape a closed box? Then its other proportions are closed boxes, too, and all that one sees of them is alike."""

from __future__ import annotations

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.geometry.pose import transform_points
from stages.shape.shape import Shape
from stages.shape.views.buffers import visible_triangles
from stages.shape.views.camera import Camera
from stages.shape.views.scene import mesh_scene

SIDES = ((0, 0), (90, 0), (180, 0), (270, 0), (0, 90), (0, -90))
"""Azimuth and elevation, in degrees, from which each side of a box is seen."""
PIXELS = 64
DEPTH = 0.02
"""What lies no deeper than this, as a share of the box, is of its side."""
PLAIN = 0.85
"""A side is plain if it has nothing else in so much of its picture."""


def is_closed_box(shape: Shape) -> bool:
    """Whether all sides of a shape but one, at least, are plain: a cabinet is one, with all its drawers and doors in
    front; a shelf is open on one side or two, with boards to be seen behind."""
    return bool(np.sort(side_shares(shape))[1] >= PLAIN)


def side_shares(shape: Shape) -> FloatArray:
    """For each of SIDES, float64 (6,), how much of the side of the box around a shape is its own surface."""
    placed = zip(shape.assembly.types.tolist(), shape.placements, strict=True)
    parts = [(transform_points(pose, shape.meshes[kind].vertices), shape.meshes[kind].faces) for kind, pose in placed]
    shifts = np.cumsum([0, *(len(vertices) for vertices, _ in parts[:-1])])
    vertices = np.concatenate([vertices for vertices, _ in parts])
    faces = np.concatenate([own + shift for (_, own), shift in zip(parts, shifts, strict=True)]).astype(np.int32)
    cube = (vertices - vertices.min(axis=0)) / np.maximum(np.ptp(vertices, axis=0), np.finfo(float).tiny)
    scene = mesh_scene(cube, faces, np.zeros((len(faces), 3), dtype=np.uint8), shape.up)
    shares = []
    for azimuth, elevation in SIDES:
        camera = Camera(azimuth, elevation, "orthographic", margin=0.0)
        seen = visible_triangles(scene, camera, (PIXELS, PIXELS), "raster")
        axis = int(np.abs(seen.view.eye[2, :3]).argmax())
        places = cube[faces][:, :, axis]
        depths = (1.0 - places if seen.view.eye[2, axis] > 0 else places).max(axis=1)
        shown = seen.triangles[seen.triangles >= 0]
        shares.append(float((depths[shown] <= DEPTH).sum()) / seen.triangles.size)
    return np.array(shares)
