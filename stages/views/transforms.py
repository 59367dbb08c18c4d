"""`transforms.json`: the cameras of a sample as NeRF tools read them (instant-ngp, nerfstudio)."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np


def transforms_bytes(cameras: Sequence[Mapping[str, Any]], images: Sequence[str]) -> bytes:
    """Return the JSON of a sample's cameras.

    cameras: their fields in the record
    images: file of each camera's colour image

    Matrices are camera-to-world with OpenGL's axes: x right, y up, z backwards. Raises ValueError for orthographic
    cameras, which these tools do not know.
    """
    if any(camera["projection"] != "perspective" for camera in cameras):
        raise ValueError("transforms.json has no orthographic cameras")
    frames = []
    for camera, image in zip(cameras, images, strict=True):
        (across, _, cx), (_, down, cy), _ = camera["intrinsics"]
        pose = np.array(camera["world_to_camera"])
        to_world = np.eye(4)
        to_world[:3, :3] = pose[:3, :3].T * np.array([1.0, -1.0, -1.0])
        for axis in range(3):
            to_world[axis, 3] = -sum(float(pose[k, axis] * pose[k, 3]) for k in range(3))
        frames.append(
            {
                "file_path": image,
                "transform_matrix": (np.round(to_world, 9) + 0.0).tolist(),
                "fl_x": across,
                "fl_y": down,
                "cx": cx,
                "cy": cy,
                "w": camera["width"],
                "h": camera["height"],
                "camera_angle_x": round(2.0 * math.atan(camera["width"] / (2.0 * across)), 9),
            }
        )
    document = {"camera_angle_x": frames[0]["camera_angle_x"], "camera_model": "PINHOLE", "frames": frames}
    return json.dumps(document, indent=1).encode() + b"\n"
