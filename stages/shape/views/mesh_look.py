"""The looks of a set of meshes as arrays from which compiled code takes the colour of each sample of a picture.

Normals, roughness and metal, occlusion and emission are such looks, too: their numbers take the place of colours.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from stages.shape.appearance import Appearance, Texture, joined_appearance
from stages.shape.arrays import BoolArray, ByteArray, Float32Array, FloatArray, IntArray
from stages.shape.views.palette import srgb_to_linear

NO_BEND = (0.0, 0.0, 1.0)
MATT = (0.0, -1.0, 0.0)
"""Finish of a material that reflects nothing: no metal, and no texture of it."""
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


class SurfaceMaps(NamedTuple):
    """What materials have besides their base colours; None where no material has it.

    bends: normals in the frames of faces, not of unit length
    finish: green: roughness, negative for MATT; blue: metal
    occlusion: red: share of the sky that is seen
    occlusion_strength: of each material, then 0 for faces without one, float64 (m + 1,)
    emission: linear light
    """

    bends: MeshLook | None
    finish: MeshLook | None
    occlusion: MeshLook | None
    occlusion_strength: FloatArray
    emission: MeshLook | None


def mesh_look(appearances: Sequence[Appearance | None], face_counts: Sequence[int]) -> MeshLook | None:
    """Return the looks of meshes, one after another; None if no face has a material."""
    whole = joined_appearance(appearances, face_counts)
    if whole is None or not whole.materials:
        return None
    materials = whole.materials
    look = _look(whole, [item.base_color[:3] for item in materials], [item.texture for item in materials], _linear)
    look.base[:, 3] = [material.base_color[3] for material in materials]
    return look._replace(
        mode=np.array([ALPHA_MODES[material.alpha_mode] for material in materials], dtype=np.int64),
        cutoff=np.array([material.alpha_cutoff for material in materials], dtype=np.float64),
    )


def surface_maps(appearances: Sequence[Appearance | None], face_counts: Sequence[int]) -> SurfaceMaps | None:
    """Return what the materials of meshes have besides base colours; None if they have nothing."""
    whole = joined_appearance(appearances, face_counts)
    if whole is None:
        return None
    items = whole.materials
    shines = [item.metallic > 0.0 or item.metallic_roughness_texture is not None for item in items]
    bent = [item.normal_texture is not None for item in items]
    shaded = [item.occlusion_texture is not None for item in items]
    glows = [any(item.emissive) for item in items]
    if not any((*shines, *bent, *shaded, *glows)):
        return None
    bends = [(item.normal_scale, item.normal_scale, 1.0) if item.normal_texture else NO_BEND for item in items]
    finish = [(0.0, item.roughness, item.metallic) if own else MATT for item, own in zip(items, shines, strict=True)]
    white = [(1.0, 1.0, 1.0)] * len(items)
    return SurfaceMaps(
        _look(whole, bends, [item.normal_texture for item in items], _signed) if any(bent) else None,
        _look(whole, finish, [item.metallic_roughness_texture for item in items], _numbers) if any(shines) else None,
        _look(whole, white, [item.occlusion_texture for item in items], _numbers) if any(shaded) else None,
        np.array([*(item.occlusion_strength for item in items), 0.0]),
        _look(whole, [item.emissive for item in items], [item.emissive_texture for item in items], _linear)
        if any(glows)
        else None,
    )


def face_frames(corners: FloatArray, uv: Float32Array) -> FloatArray:
    """Return where texture coordinates grow on each face, to the right and upwards, of any length, float64 (f, 2, 3).

    corners: float64 (f, 3, 3)
    uv: origin at the upper left, float32 (f, 3, 2)

    Zero on faces whose coordinates have no area.
    """
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    one, two = ((uv[:, corner] - uv[:, 0]).astype(np.float64) for corner in (1, 2))
    side = np.sign(one[:, 0] * two[:, 1] - two[:, 0] * one[:, 1])[:, None]
    right = side * (two[:, 1:] * first - one[:, 1:] * second)
    return np.stack([right, side * (two[:, :1] * first - one[:, :1] * second)], axis=1)


def _look(
    whole: Appearance,
    base: Sequence[tuple[float, float, float]],
    textures_of: Sequence[Texture | None],
    decode: Callable[[ByteArray], Float32Array],
) -> MeshLook:
    """Return an opaque look: a base and a texture, or none, of each material.

    decode: from pixels to numbers times alpha, and alpha, float32 (h, w, 4)
    """
    textures = list(dict.fromkeys(texture for texture in textures_of if texture is not None))
    levels_of = {texture: _levels(decode(texture.image.pixels)) for texture in textures}
    every = [level for texture in textures for level in levels_of[texture]]
    sizes = np.array([level.shape[:2] for level in every], dtype=np.int64).reshape(-1, 2)
    starts = np.cumsum([0, *(height * width for height, width in sizes.tolist())])[:-1]
    return MeshLook(
        face_material=whole.face_material,
        uv=np.zeros((len(whole), 3, 2), np.float32) if whole.uv is None else whole.uv,
        base=np.array([(*numbers, 1.0) for numbers in base], dtype=np.float64),
        texture=np.array([_number(texture, textures) for texture in textures_of], dtype=np.int64),
        mode=np.zeros(len(base), dtype=np.int64),
        cutoff=np.zeros(len(base), dtype=np.float64),
        texels=np.concatenate([np.zeros((1, 4), np.float32), *(level.reshape(-1, 4) for level in every)])[1:],
        levels=np.column_stack([starts, sizes[:, 1], sizes[:, 0]]).astype(np.int64),
        level_first=np.cumsum([0, *(len(levels_of[texture]) for texture in textures)]).astype(np.int64),
        wraps=np.array([(WRAPS[item.wrap_u], WRAPS[item.wrap_v]) for item in textures], np.int64).reshape(-1, 2),
        nearest=np.array([texture.nearest for texture in textures], dtype=np.bool_),
    )


def _number(texture: Texture | None, textures: Sequence[Texture]) -> int:
    return -1 if texture is None else textures.index(texture)


def _levels(level: Float32Array) -> list[Float32Array]:
    """Return an image (h, w, 4) in halves of its size down to one texel."""
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


def _numbers(pixels: ByteArray) -> Float32Array:
    """Return the numbers of pixels, 0 to 1, without their alpha."""
    return np.concatenate([pixels[:, :, :3] / 255.0, np.ones((*pixels.shape[:2], 1))], axis=2).astype(np.float32)


def _signed(pixels: ByteArray) -> Float32Array:
    """Return the numbers of pixels, -1 to 1, without their alpha."""
    return np.concatenate([pixels[:, :, :3] / 127.5 - 1.0, np.ones((*pixels.shape[:2], 1))], axis=2).astype(np.float32)
