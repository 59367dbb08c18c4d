"""Which of a scene's look is kept: textures at a size, or the colours of faces alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from stages.model_files.colors import linear_from_srgb, srgb_from_linear
from stages.model_files.scene import ModelScene
from stages.shape.appearance import Appearance, TextureImage, shared_materials
from stages.shape.arrays import ByteArray


def keep_appearance(scene: ModelScene, texture_size: int | None) -> ModelScene:
    """Return the scene with textures of at most `texture_size` pixels a side, or, for None, with face colours alone.

    What is not kept becomes a warning.
    """
    looks = [surface.appearance for surface in scene.surfaces if surface.appearance is not None]
    materials, _ = shared_materials(looks)
    images = {material.texture.image for material in materials if material.texture is not None}
    if texture_size is None:
        colored = tuple(replace(surface, appearance=None) for surface in scene.surfaces)
        clear = sum(material.alpha_mode != "opaque" for material in materials)
        counts = {"texture": len(images), "see-through material": clear}
        lost = [f"{count} {what}{'s' * (count > 1)}" for what, count in counts.items() if count]
        verb = "is" if sum(counts.values()) == 1 else "are"
        warning = f"{' and '.join(lost)} {verb} read as opaque colours of faces; `appearance: textures` keeps them"
        warnings = (*scene.warnings, warning) if lost else scene.warnings
        return replace(scene, surfaces=colored, warnings=warnings, not_kept=())
    small = {image: TextureImage.of(shrunk(image.pixels, texture_size)) for image in images}
    surfaces = tuple(
        surface if surface.appearance is None else replace(surface, appearance=_with_images(surface.appearance, small))
        for surface in scene.surfaces
    )
    return replace(scene, surfaces=surfaces, warnings=(*scene.warnings, *scene.not_kept), not_kept=())


def shrunk(pixels: ByteArray, max_side: int) -> ByteArray:
    """Return sRGB pixels (h, w, 3 or 4) at most `max_side` high and wide: means of linear light, weighted by alpha."""
    from PIL import Image

    height, width = pixels.shape[:2]
    scale = max_side / max(height, width)
    if scale >= 1.0:
        return pixels
    size = max(round(width * scale), 1), max(round(height * scale), 1)
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


def _with_images(look: Appearance, images: dict[TextureImage, TextureImage]) -> Appearance:
    """Return the look with other images in its textures; materials not in use keep no texture."""
    materials = tuple(
        material
        if material.texture is None
        else replace(material, texture=replace(material.texture, image=images[material.texture.image]))
        if material.texture.image in images
        else replace(material, texture=None)
        for material in look.materials
    )
    return replace(look, materials=materials)
