"""The images of one view of a sample, as files."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from pipeline.errors import Rejected
from stages.shape.arrays import ByteArray, Float32Array, TypeArray
from stages.shape.views.camera_record import camera_fields
from stages.shape.views.image_files import (
    ChannelType,
    color_png_bytes,
    data_png_bytes,
    exr_bytes,
    jpeg_bytes,
    png_bytes,
    webp_bytes,
)
from stages.sketches.draw import draw_visible
from stages.sketches.settings import StrokeOptions
from stages.views.numbers import depth_levels, depth_scale, normal_bytes, rounded_depth
from stages.views.render import SeenSurface, ViewRenderer
from stages.views.settings import ColorOptions, ViewsConfig
from stages.views.shading import Lamp, to_srgb, view_light

COLOR_SUFFIX = {"png": "png", "jpeg": "jpg", "webp": "webp"}
DRAWING_SUPERSAMPLE = 2
NORMAL_CHANNELS = ("N.X", "N.Y", "N.Z")
SURFACE_IMAGES = frozenset({"depth", "normals", "instances", "classes", "mask"})


def view_files(
    config: ViewsConfig, renderer: ViewRenderer, lamp: Lamp | None, part_classes: TypeArray, index: int
) -> tuple[dict[str, bytes], dict[str, Any]]:
    """Return the members of view `index`, and its fields in the record.

    lamp: None for unlit colours
    part_classes: class of each part, (n,)

    Raises Rejected where the camera sees nothing of the shape.
    """
    fields = camera_fields(renderer.view, config.width, config.height)
    files: dict[str, bytes] = {}
    if "color" in config.images:
        light = view_light(renderer, config.color.supersample, lamp)
        pixels = to_srgb(light, config.color.background == "transparent")
        files[f"color{index}.{COLOR_SUFFIX[config.color.format]}"] = formatted_colors(pixels, config.color)
    if SURFACE_IMAGES & set(config.images):
        surface = renderer.surface(config.normals_space == "world")
        if config.multichannel:
            files[f"view{index}.exr"] = exr_bytes(surface_channels(config, surface, part_classes))
        else:
            files |= _surface_files(config, surface, part_classes, index)
            if "depth" in config.images and config.depth_format == "png":
                fields["depth_scale"] = depth_scale(surface.depth)
    if "drawing" in config.images:
        drawing = draw_visible(renderer.visible(DRAWING_SUPERSAMPLE), DRAWING_SUPERSAMPLE, StrokeOptions())
        if drawing.min() == drawing.max():
            raise Rejected("blank drawing", f"view {index}")
        files[f"drawing{index}.png"] = png_bytes(drawing)
    return files, fields


def formatted_colors(pixels: ByteArray, options: ColorOptions) -> bytes:
    """Return colours, uint8 (h, w, 3 or 4), in the format of the config."""
    if options.format == "png":
        return color_png_bytes(pixels)
    return (jpeg_bytes if options.format == "jpeg" else webp_bytes)(pixels, options.quality)


def _surface_files(
    config: ViewsConfig, surface: SeenSurface, part_classes: TypeArray, index: int
) -> Mapping[str, bytes]:
    """Return the files of the surface in the order of the config's images."""
    files = {}
    for kind in config.images:
        if kind == "depth" and config.depth_format == "exr":
            files[f"depth{index}.exr"] = exr_bytes({"Z": (rounded_depth(surface.depth), "float")})
        elif kind == "depth":
            files[f"depth{index}.png"] = data_png_bytes(
                depth_levels(surface.depth, depth_scale(surface.depth)), smooth=True
            )
        elif kind == "normals" and config.normals_format == "exr":
            files[f"normals{index}.exr"] = exr_bytes(_normal_channels(surface))
        elif kind == "normals":
            files[f"normals{index}.png"] = data_png_bytes(normal_bytes(surface.normals))
        elif kind == "instances":
            files[f"instances{index}.png"] = data_png_bytes((surface.instances + 1).astype(np.uint16))
        elif kind == "classes":
            files[f"classes{index}.png"] = data_png_bytes((_classes(surface, part_classes) + 1).astype(np.uint16))
        elif kind == "mask":
            files[f"mask{index}.png"] = data_png_bytes(np.where(surface.mask, 255, 0).astype(np.uint8))
    return files


def surface_channels(
    config: ViewsConfig, surface: SeenSurface, part_classes: TypeArray
) -> dict[str, tuple[Float32Array, ChannelType]]:
    """Return the channels of a view's EXR, by name, with their types in the file."""
    channels: dict[str, tuple[Float32Array, ChannelType]] = {}
    for kind in config.images:
        if kind == "depth":
            channels["Z"] = rounded_depth(surface.depth), "float"
        elif kind == "normals":
            channels |= _normal_channels(surface)
        elif kind == "instances":
            channels["instance"] = (surface.instances + 1).astype(np.float32), "float"
        elif kind == "classes":
            channels["class"] = (_classes(surface, part_classes) + 1).astype(np.float32), "float"
        elif kind == "mask":
            channels["mask"] = surface.mask.astype(np.float32), "half"
    return channels


def _normal_channels(surface: SeenSurface) -> dict[str, tuple[Float32Array, ChannelType]]:
    return {name: (surface.normals[:, :, axis], "half") for axis, name in enumerate(NORMAL_CHANNELS)}


def _classes(surface: SeenSurface, part_classes: TypeArray) -> np.ndarray:
    """Return the class of each pixel, int32 (h, w), -1 where nothing is seen."""
    classes: np.ndarray = np.where(surface.mask, part_classes.astype(np.int32)[surface.instances], -1)
    return classes
