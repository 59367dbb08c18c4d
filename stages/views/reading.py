"""The views of a finished sample as arrays."""

from __future__ import annotations

import io
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from stages.shape.arrays import BoolArray, ByteArray, Float32Array, FloatArray, IntArray

ID_CHANNELS = {"instances": "instance", "classes": "class"}
NORMAL_CHANNELS = ("N.X", "N.Y", "N.Z")


@dataclass(frozen=True)
class SampleView:
    """A camera of a sample and its images. An image that the dataset does not have raises KeyError.

    camera: fields of the camera in the record
    images: arrays of `read_view` by name
    """

    camera: Mapping[str, Any]
    images: Mapping[str, np.ndarray]

    @property
    def color(self) -> ByteArray:
        """SRGB colours, uint8 (h, w, 3), or (h, w, 4) with alpha."""
        return self.images["color"]

    @property
    def depth(self) -> Float32Array:
        """Depth along the axis of the camera in the unit of the mesh, 0 where nothing is seen, float32 (h, w)."""
        return self.images["depth"]

    @property
    def normals(self) -> Float32Array:
        """Unit normals, zero where nothing is seen, float32 (h, w, 3)."""
        return self.images["normals"]

    @property
    def instances(self) -> IntArray:
        """Index of the part in the record, -1 where nothing is seen, int32 (h, w)."""
        return self.images["instances"]

    @property
    def classes(self) -> IntArray:
        """Class id of the part, -1 where nothing is seen, int32 (h, w)."""
        return self.images["classes"]

    @property
    def mask(self) -> BoolArray:
        """Whether the shape is seen, bool (h, w)."""
        return self.images["mask"]

    @cached_property
    def points(self) -> FloatArray:
        """Seen points of the surface in the coordinates of the mesh, from depth and camera, float64 (n, 3).

        They are in the order of `depth[depth > 0]`.
        """
        from stages.shape.views.camera_record import pixel_rays

        height, width = self.depth.shape
        origins, directions = pixel_rays(self.camera, np.arange(0.5, width), np.arange(0.5, height))
        seen = self.depth > 0
        points: FloatArray = origins[seen] + self.depth[seen][:, None] * directions[seen]
        return points


def read_views(members: Mapping[str, bytes], cameras: list[dict[str, Any]]) -> tuple[SampleView, ...]:
    """Return the views of a sample.

    members: bytes of its members by name
    cameras: the field `views` of its record
    """
    return tuple(
        SampleView(camera, read_view(members, index, float(camera.get("depth_scale", 1.0))))
        for index, camera in enumerate(cameras)
    )


def read_view(members: Mapping[str, bytes], index: int, depth_scale: float = 1.0) -> dict[str, np.ndarray]:
    """Return the images of view `index` by name, as the properties of `SampleView` describe them.

    depth_scale: length of a level of a 16-bit depth image

    Raises ValueError for a file that cannot be read.
    """
    from stages.shape.views.image_files import read_exr

    images: dict[str, np.ndarray] = {}
    for name, content in members.items():
        stem, _, suffix = name.partition(".")
        kind = stem.rstrip("0123456789")
        if stem != f"{kind}{index}" or kind not in KINDS or suffix not in SUFFIXES:
            continue
        if suffix == "exr":
            images |= _of_channels(read_exr(content))
        else:
            images[kind] = _of_pixels(kind, content, depth_scale)
    return images


KINDS = frozenset({"color", "depth", "normals", "instances", "classes", "mask", "drawing", "view"})
SUFFIXES = frozenset({"png", "jpg", "webp", "exr"})


def _of_channels(channels: Mapping[str, Float32Array]) -> dict[str, np.ndarray]:
    from stages.views.numbers import unit_length

    images: dict[str, np.ndarray] = {}
    if "Z" in channels:
        images["depth"] = channels["Z"]
    if "N.X" in channels:
        images["normals"] = unit_length(np.stack([channels[name] for name in NORMAL_CHANNELS], axis=-1))
    for kind, channel in ID_CHANNELS.items():
        if channel in channels:
            images[kind] = channels[channel].astype(np.int32) - 1
    if "mask" in channels:
        images["mask"] = channels["mask"] > 0
    return images


def _of_pixels(kind: str, content: bytes, depth_scale: float) -> np.ndarray:
    from PIL import Image

    from stages.views.numbers import normals_of

    try:
        pixels = np.asarray(Image.open(io.BytesIO(content)))
    except (OSError, SyntaxError) as error:
        raise ValueError(f"{kind} cannot be read: {error}") from error
    if kind == "depth":
        return (pixels * depth_scale).astype(np.float32)
    if kind == "normals":
        return normals_of(pixels)
    if kind in ID_CHANNELS:
        return pixels.astype(np.int32) - 1
    return pixels > 0 if kind == "mask" else pixels
