"""Cameras in records, with OpenCV's axes: how points of the mesh map to a picture, and back to rays."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.views.camera import View

OPENGL_TO_OPENCV = np.diag([1.0, -1.0, -1.0, 1.0])
CAMERA_DECIMALS = 12
"""Decimals of a matrix; further digits are noise."""

_PIXELS = {"type": "integer", "minimum": 1}
_ROW = {"type": "array", "items": {"type": "number"}}

CAMERA_FIELDS: Mapping[str, Any] = {
    "width": {"description": "of the picture; unit: pixels", **_PIXELS},
    "height": {"description": "of the picture; unit: pixels", **_PIXELS},
    "projection": {
        "description": "perspective: a point (x, y, z) of the camera's coordinates is seen at intrinsics * (x/z, y/z, "
        "1); orthographic: at intrinsics * (x, y, 1)",
        "enum": ["perspective", "orthographic"],
    },
    "intrinsics": {
        "description": "K, 3x3, to pixels: (0, 0) is the upper left corner of the picture, (0.5, 0.5) the middle of "
        "its first pixel, x points right, y down. Where the picture is flipped, its first number is negative",
        "type": "array",
        "items": {**_ROW, "minItems": 3, "maxItems": 3},
        "minItems": 3,
        "maxItems": 3,
    },
    "world_to_camera": {
        "description": "4x4, rigid, from the coordinates of the mesh to the camera's, which are OpenCV's: x points "
        "right, y down, z into the picture",
        "type": "array",
        "items": {**_ROW, "minItems": 4, "maxItems": 4},
        "minItems": 4,
        "maxItems": 4,
    },
}
"""JSON schema of the fields of `camera_fields`, by name."""


def camera_fields(view: View, width: int, height: int, flipped: bool = False) -> dict[str, Any]:
    """Return the record of the camera of a picture.

    width, height: size of the picture in pixels
    flipped: whether the picture was mirrored after it was drawn
    """
    across, down = view.projection[0, 0] * width / 2, view.projection[1, 1] * height / 2
    intrinsics = np.array([[-across if flipped else across, 0.0, width / 2], [0.0, down, height / 2], [0.0, 0.0, 1.0]])
    # adding zero turns minus zeros into zeros, which read better in text
    matrices = {"intrinsics": intrinsics, "world_to_camera": OPENGL_TO_OPENCV @ view.eye}
    return {
        "width": width,
        "height": height,
        "projection": "perspective" if view.perspective else "orthographic",
        **{name: (np.round(matrix, CAMERA_DECIMALS) + 0.0).tolist() for name, matrix in matrices.items()},
    }


def projected(camera: Mapping[str, Any], points: FloatArray) -> FloatArray:
    """Return the pixels, float64 (n, 2), where a camera of a record sees points of the mesh (n, 3).

    Points that are not in front of it are NaN.
    """
    intrinsics, pose = np.array(camera["intrinsics"]), np.array(camera["world_to_camera"])
    seen = points @ pose[:3, :3].T + pose[:3, 3]
    if camera["projection"] == "perspective":
        depth = np.where(seen[:, 2:] > 0.0, seen[:, 2:], np.nan)
        seen = seen / depth
    pixels: FloatArray = seen[:, :2] @ intrinsics[:2, :2].T + intrinsics[:2, 2]
    return pixels


def pixel_rays(camera: Mapping[str, Any], columns: FloatArray, rows: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return origins and directions, float64 (h, w, 3), of the rays through picture points, in mesh coordinates.

    columns, rows: coordinates of the points in pixels, (w,) and (h,)
    """
    return picture_rays(camera, np.stack(np.meshgrid(columns, rows), axis=-1))


def picture_rays(camera: Mapping[str, Any], pixels: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return origins and directions, float64 (..., 3), of the rays through picture points, in mesh coordinates.

    pixels: coordinates of the points in pixels, (..., 2)

    The directions are as long as the way from one unit of depth to the next.
    """
    intrinsics, pose = np.array(camera["intrinsics"]), np.array(camera["world_to_camera"])
    rotation, origin = pose[:3, :3].T, -pose[:3, :3].T @ pose[:3, 3]
    x = (pixels[..., 0] - intrinsics[0, 2]) / intrinsics[0, 0]
    y = (pixels[..., 1] - intrinsics[1, 2]) / intrinsics[1, 1]
    ahead = np.stack([x, y, np.ones_like(x)], axis=-1)
    if camera["projection"] == "perspective":
        return np.broadcast_to(origin, ahead.shape), ahead @ rotation.T
    in_plane = np.stack([x, y, np.zeros_like(x)], axis=-1)
    return in_plane @ rotation.T + origin, np.broadcast_to(rotation[:, 2], ahead.shape)
