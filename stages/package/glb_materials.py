"""Materials, textures and images of a GLB: each once, images as PNG or JPEG inside the file.

Every loader that was tried shows both formats. WebP is smaller, but it needs an extension that pyrender and Open3D do
not read. A JPEG is taken where it is opaque and less than half as large as the PNG: for photos, and not for palettes.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from stages.shape.appearance import Material, Texture, TextureImage
from stages.shape.views.image_files import color_png_bytes, jpeg_bytes

JPEG_QUALITY = 90
MAX_JPEG_SHARE = 0.5
"""A JPEG is taken where it is smaller than this share of the PNG."""
PNG_EFFORT = 9
_WRAPS = {"repeat": 10497, "mirror": 33648, "clamp": 33071}
_TEXTURE_KEYS = {
    "texture": "baseColorTexture",
    "metallic_roughness_texture": "metallicRoughnessTexture",
    "normal_texture": "normalTexture",
    "occlusion_texture": "occlusionTexture",
    "emissive_texture": "emissiveTexture",
}
_NEAREST_FILTER, _LINEAR_FILTER, _MIPMAP_FILTER = 9728, 9729, 9987


class MaterialTable:
    """The materials of one file, in the order of their first use."""

    def __init__(self) -> None:
        self._materials: dict[Material, int] = {}
        self._textures: dict[Texture, int] = {}
        self._images: dict[TextureImage, int] = {}
        self._samplers: dict[tuple[str, str, bool], int] = {}

    def index(self, material: Material) -> int:
        """Return the number of a material, which is added if new."""
        if material not in self._materials:
            for texture in material.textures.values():
                self._images.setdefault(texture.image, len(self._images))
                self._samplers.setdefault((texture.wrap_u, texture.wrap_v, texture.nearest), len(self._samplers))
                self._textures.setdefault(texture, len(self._textures))
        return self._materials.setdefault(material, len(self._materials))

    @property
    def image_files(self) -> list[bytes]:
        """The files of the images, in the order of their numbers."""
        return [_image_file(image)[0] for image in self._images]

    def header(self, first_view: int) -> dict[str, Any]:
        """Return the parts of glTF's JSON that are not empty. first_view: number of the view of the first image."""
        textures = [
            {
                "sampler": self._samplers[texture.wrap_u, texture.wrap_v, texture.nearest],
                "source": self._images[texture.image],
            }
            for texture in self._textures
        ]
        samplers = [
            {
                "magFilter": _NEAREST_FILTER if nearest else _LINEAR_FILTER,
                "minFilter": _MIPMAP_FILTER,
                "wrapS": _WRAPS[wrap_u],
                "wrapT": _WRAPS[wrap_v],
            }
            for wrap_u, wrap_v, nearest in self._samplers
        ]
        images = [
            {"bufferView": first_view + number, "mimeType": _image_file(image)[1]}
            for number, image in enumerate(self._images)
        ]
        materials = [self._described(material) for material in self._materials]
        tables = {"materials": materials, "textures": textures, "samplers": samplers, "images": images}
        return {name: rows for name, rows in tables.items() if rows}

    def _described(self, material: Material) -> dict[str, Any]:
        surface: dict[str, Any] = {
            "baseColorFactor": list(material.base_color),
            "metallicFactor": material.metallic,
            "roughnessFactor": material.roughness,
        }
        described: dict[str, Any] = {"name": material.name, "pbrMetallicRoughness": surface}
        for field, texture in material.textures.items():
            holder = surface if field in ("texture", "metallic_roughness_texture") else described
            holder[_TEXTURE_KEYS[field]] = {"index": self._textures[texture]}
        if material.normal_texture is not None and material.normal_scale != 1.0:
            described["normalTexture"]["scale"] = material.normal_scale
        if material.occlusion_texture is not None and material.occlusion_strength != 1.0:
            described["occlusionTexture"]["strength"] = material.occlusion_strength
        if any(material.emissive):
            described["emissiveFactor"] = list(material.emissive)
        if material.alpha_mode != "opaque":
            described["alphaMode"] = material.alpha_mode.upper()
        if material.alpha_mode == "mask":
            described["alphaCutoff"] = material.alpha_cutoff
        if material.double_sided:
            described["doubleSided"] = True
        return described


@lru_cache(maxsize=256)
def _image_file(image: TextureImage) -> tuple[bytes, str]:
    """Return the file of an image and its MIME type."""
    png = color_png_bytes(image.pixels, PNG_EFFORT)
    if image.pixels.shape[2] == 3:
        jpeg = jpeg_bytes(image.pixels, JPEG_QUALITY)
        if len(jpeg) < MAX_JPEG_SHARE * len(png):
            return jpeg, "image/jpeg"
    return png, "image/png"
