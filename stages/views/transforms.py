"""`transforms.json`: the cameras of a sample as NeRF tools read them (instant-ngp, nerfstudio)."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

TRANSFORMS = "transforms.json"


def transforms_bytes(key: str, cameras: Sequence[Mapping[str, Any]], images: Sequence[str]) -> bytes:
    """Return the JSON of a sample's cameras.

    key: of the sample; the files of an unpacked shard are named `<key>.<image>`
    cameras: their fields in the record
    images: member of each camera's colour image

    Matrices are camera-to-world with OpenGL's axes: x right, y up, z backwards.
    """
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
                "file_path": f"{key}.{image}",
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
