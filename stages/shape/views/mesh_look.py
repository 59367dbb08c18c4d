"""The looks of a set of meshes as arrays from which compiled code takes the colour of each sample of a picture."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from stages.shape.appearance import Appearance, Texture, TextureImage, joined
from stages.shape.arrays import BoolArray, ByteArray, Float32Array, FloatArray, IntArray
from stages.shape.views.palette import srgb_to_linear

ALPHA_MODES = {"opaque": 0, "mask": 1, "blend": 2}
WRAPS = {"repeat": 0, "mirror": 1, "clamp": 2}


class MeshLook(NamedTuple):
    """Materials and textures of a set of meshes with f faces in all.

    face_material: row of the materials, or -1, int32 (f,)
    uv: texture coordinates, origin at the upper left, float32 (f, 3, 2)
    base: linear color and alpha of each material, float64 (m, 4)
    texture: number of each material's texture, or -1, int64 (m,)
    mode: alpha mode of each material, int64 (m,); cutoff: float64 (m,)
    texels: linear colors times alpha, and alpha, of all levels of all textures, float32 (n, 4)
    levels: first texel, width and height of each level, int64 (l, 3); each level is half as wide as the one before
    level_first: first level of each texture, then the total, int64 (t + 1,)
    wraps: of each texture along u and v, int64 (t, 2)
    nearest: whether texels of each texture show as squares, bool (t,)
    """

    face_material: IntArray
    uv: Float32Array
    base: FloatArray
    texture: np.ndarray
    mode: np.ndarray
    cutoff: FloatArray
    texels: Float32Array
    levels: np.ndarray
    level_first: np.ndarray
    wraps: np.ndarray
    nearest: BoolArray

    @property
    def has_holes(self) -> BoolArray:
        """Whether each face is masked or blended, so that something behind it may be seen, bool (f,)."""
        holes: BoolArray = np.array([*(self.mode > 0), False])[self.face_material]
        return holes

    @property
    def is_blended(self) -> BoolArray:
        """Whether each face is blended with what is behind it, bool (f,)."""
        blended: BoolArray = np.array([*(self.mode == ALPHA_MODES["blend"]), False])[self.face_material]
        return blended


def mesh_look(appearances: Sequence[Appearance | None], face_counts: Sequence[int]) -> MeshLook | None:
    """Return the looks of meshes, one after another; None if no face has a material."""
    whole = joined(appearances, face_counts)
    if whole is None or not whole.materials:
        return None
    textures = list(dict.fromkeys(material.texture for material in whole.materials if material.texture is not None))
    levels_of = {texture: _levels(texture.image) for texture in textures}
    every = [level for texture in textures for level in levels_of[texture]]
    sizes = np.array([level.shape[:2] for level in every], dtype=np.int64).reshape(-1, 2)
    starts = np.cumsum([0, *(height * width for height, width in sizes.tolist())])[:-1]
    materials = whole.materials
    return MeshLook(
        face_material=whole.face_material,
        uv=np.zeros((len(whole), 3, 2), np.float32) if whole.uv is None else whole.uv,
        base=np.array([material.base_color for material in materials], dtype=np.float64),
        texture=np.array([_number(material.texture, textures) for material in materials], dtype=np.int64),
        mode=np.array([ALPHA_MODES[material.alpha_mode] for material in materials], dtype=np.int64),
        cutoff=np.array([material.alpha_cutoff for material in materials], dtype=np.float64),
        texels=np.concatenate([np.zeros((1, 4), np.float32), *(level.reshape(-1, 4) for level in every)])[1:],
        levels=np.column_stack([starts, sizes[:, 1], sizes[:, 0]]).astype(np.int64),
        level_first=np.cumsum([0, *(len(levels_of[texture]) for texture in textures)]).astype(np.int64),
        wraps=np.array([(WRAPS[item.wrap_u], WRAPS[item.wrap_v]) for item in textures], np.int64).reshape(-1, 2),
        nearest=np.array([texture.nearest for texture in textures], dtype=np.bool_),
    )


def _number(texture: Texture | None, textures: Sequence[Texture]) -> int:
    return -1 if texture is None else textures.index(texture)


def _levels(image: TextureImage) -> list[Float32Array]:
    """Return an image in halves of its size down to one texel: linear color times alpha, and alpha, (h, w, 4)."""
    level = _linear(image.pixels)
    levels = [level]
    while max(level.shape[:2]) > 1:
        for axis in (0, 1):
            if level.shape[axis] % 2 and level.shape[axis] > 1:
                level = np.concatenate([level, level.take([-1], axis=axis)], axis=axis)
            if level.shape[axis] > 1:
                even, odd = (level.take(range(start, level.shape[axis], 2), axis=axis) for start in (0, 1))
                level = (even + odd) * np.float32(0.5)
        levels.append(level)
    return levels


def _linear(pixels: ByteArray) -> Float32Array:
    alpha = pixels[:, :, 3:] / 255.0 if pixels.shape[2] == 4 else np.ones((*pixels.shape[:2], 1))
    return np.concatenate([srgb_to_linear(pixels[:, :, :3]) * alpha, alpha], axis=2).astype(np.float32)
