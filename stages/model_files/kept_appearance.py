"""Which of a scene's look is kept: textures at a size, or the colours of faces alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from stages.model_files.colors import linear_from_srgb, srgb_from_linear
from stages.model_files.scene import ModelScene
from stages.shape.appearance import TEXTURE_FIELDS, Appearance, TextureImage, shared_materials
from stages.shape.arrays import ByteArray

_COLOR_FIELDS = ("texture", "emissive_texture")
"""Textures of colours in sRGB; the others hold numbers."""


def keep_appearance(scene: ModelScene, texture_size: int | None) -> ModelScene:
    """Return the scene with textures of at most `texture_size` pixels a side, or, for None, with face colours alone.

    What is not kept becomes a warning.
    """
    looks = [surface.appearance for surface in scene.surfaces if surface.appearance is not None]
    materials, _ = shared_materials(looks)
    images = {(texture.image, name in _COLOR_FIELDS) for look in materials for name, texture in look.textures.items()}
    if texture_size is None:
        colored = tuple(replace(surface, appearance=None) for surface in scene.surfaces)
        clear = sum(material.alpha_mode != "opaque" for material in materials)
        counts = {"texture": len({image for image, _ in images}), "see-through material": clear}
        lost = [f"{count} {what}{'s' * (count > 1)}" for what, count in counts.items() if count]
        verb = "is" if sum(counts.values()) == 1 else "are"
        warning = f"{' and '.join(lost)} {verb} read as opaque colours of faces; `appearance: textures` keeps them"
        warnings = (*scene.warnings, warning) if lost else scene.warnings
        return replace(scene, surfaces=colored, warnings=warnings, not_kept=())
    small = {
        (image, is_color): TextureImage.of(shrunk(image.pixels, texture_size, is_color)) for image, is_color in images
    }
    surfaces = tuple(
        surface if surface.appearance is None else replace(surface, appearance=_with_images(surface.appearance, small))
        for surface in scene.surfaces
    )
    return replace(scene, surfaces=surfaces, warnings=(*scene.warnings, *scene.not_kept), not_kept=())


def shrunk(pixels: ByteArray, max_side: int, is_color: bool = True) -> ByteArray:
    """Return pixels (h, w, 3 or 4) at most `max_side` high and wide.

    is_color: whether they are sRGB, so that means are those of linear light, weighted by alpha; else of the numbers
    """
    from PIL import Image

    height, width = pixels.shape[:2]
    scale = max_side / max(height, width)
    if scale >= 1.0:
        return pixels
    size = max(round(width * scale), 1), max(round(height * scale), 1)
    if not is_color:
        return np.asarray(Image.fromarray(pixels).resize(size, Image.Resampling.BOX))
    weight = pixels[:, :, 3] / 255.0 if pixels.shape[2] == 4 else np.ones((height, width))

    def reduced(plane: np.ndarray) -> np.ndarray:
        return np.asarray(Image.fromarray(plane.astype(np.float32)).resize(size, Image.Resampling.BOX), np.float64)

    alpha = reduced(weight)
    light = linear_from_srgb(pixels[:, :, :3]) * weight[:, :, None]
    planes = [reduced(light[:, :, channel]) / np.maximum(alpha, 1e-6) for channel in range(3)]
    colors = srgb_from_linear(np.stack(planes, axis=2))
    if pixels.shape[2] == 3:
        return colors
    levels = np.rint(255.0 * np.clip(alpha, 0.0, 1.0)).astype(np.uint8)
    return np.concatenate([colors, levels[:, :, None]], axis=2)


def _with_images(look: Appearance, images: Mapping[tuple[TextureImage, bool], TextureImage]) -> Appearance:
    """Return the look with other images in its textures; materials not in use keep no texture.

    images: by the image, and whether it is a colour
    """
    materials = []
    for material in look.materials:
        others: dict[str, Any] = dict.fromkeys(TEXTURE_FIELDS)
        for name, texture in material.textures.items():
            image = images.get((texture.image, name in _COLOR_FIELDS))
            others[name] = None if image is None else replace(texture, image=image)
        materials.append(replace(material, **others))
    return replace(look, materials=tuple(materials))
