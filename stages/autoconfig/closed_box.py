"""Test whether a shape is a closed box: resizing it only yields more closed boxes, which look alike."""

from __future__ import annotations

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.geometry.pose import transform_points
from stages.shape.shape import Shape
from stages.shape.views.buffers import visible_triangles
from stages.shape.views.camera import Camera
from stages.shape.views.scene import mesh_scene

SIDES = ((0, 0), (90, 0), (180, 0), (270, 0), (0, 90), (0, -90))
"""Azimuth and elevation, in degrees, of the views onto each side of a box."""
IMAGE_PIXELS = 64
MAX_SIDE_DEPTH = 0.02
"""Depth up to which a surface belongs to a side of the box, as a share of the box."""
MIN_SIDE_SHARE = 0.85
"""Share of the picture of a side that its own surface fills, from which the side is closed."""


def is_closed_box(shape: Shape) -> bool:
    """Return whether at least five sides of the box around a shape are closed, as those of a cabinet are."""
    return bool(np.sort(side_shares(shape))[1] >= MIN_SIDE_SHARE)


def side_shares(shape: Shape) -> FloatArray:
    """Return the share of each side of the box around a shape that its own surface fills, float64 (6,), by SIDES."""
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
        visible = visible_triangles(scene, camera, (IMAGE_PIXELS, IMAGE_PIXELS), "raster")
        axis = int(np.abs(visible.view.eye[2, :3]).argmax())
        coordinates = cube[faces][:, :, axis]
        depths = (1.0 - coordinates if visible.view.eye[2, axis] > 0 else coordinates).max(axis=1)
        shown = visible.triangles[visible.triangles >= 0]
        shares.append(float((depths[shown] <= MAX_SIDE_DEPTH).sum()) / visible.triangles.size)
    return np.array(shares)
