"""What the materials of a file become: numbers in their ranges, alpha, and what is not kept of them."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from stages.shape.appearance import NO_MATERIAL, AlphaMode, Appearance, Material
from stages.shape.arrays import ByteArray, Float32Array, FloatArray, IntArray

MIN_CUTOUT_SHARE = 0.9
"""Share of the pixels that are not opaque and wholly transparent from which alpha cuts holes, and mixes nothing."""


def stated_number(value: Any, default: float) -> float:
    """Return a number of a file in [0, 1], or the default for other values."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        return default
    return min(max(number, 0.0), 1.0) if math.isfinite(number) else default


def stated_numbers(values: Any, defaults: Sequence[float]) -> tuple[float, ...]:
    """Return numbers of a file in [0, 1], or the defaults for other values."""
    if not isinstance(values, list | tuple | np.ndarray) or len(values) != len(defaults):
        return tuple(defaults)
    return tuple(stated_number(value, default) for value, default in zip(values, defaults, strict=True))


def linear_color(srgb: Sequence[float]) -> tuple[float, float, float]:
    """Return linear red, green and blue of sRGB in [0, 1] (IEC 61966-2-1)."""
    red, green, blue = (
        value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4 for value in map(float, srgb)
    )
    return red, green, blue


def alpha_mode_of(alpha: float, pixels: ByteArray | None) -> AlphaMode:
    """Return the alpha mode of a material whose format states none, by its alpha and its texture (h, w, 3 or 4)."""
    if alpha < 1.0:
        return "blend"
    if pixels is None or pixels.shape[2] == 3:
        return "opaque"
    clear, mixed = (pixels[:, :, 3] == 0).sum(), (pixels[:, :, 3] < 255).sum()
    return "mask" if clear >= MIN_CUTOUT_SHARE * mixed else "blend"


def painted_faces_without_material(
    face_material: IntArray, materials: Sequence[Material], paint: ByteArray | None
) -> tuple[IntArray, dict[str, int]]:
    """Return the materials of faces without those of painted faces that have no texture.

    paint: vertex colours of the faces, uint8 (f, 3), white without them, or None

    Most loaders drop vertex colours where a face has a material, so such faces have colours alone. Also returns the
    number of faces of each such material by its name.
    """
    if paint is None or not len(materials):
        return face_material, {}
    textured = np.array([*(bool(material.textures) for material in materials), True])  # the last for no material
    painted = ~textured[face_material] & (paint != 255).any(axis=1)
    names = Counter(materials[number].name for number in face_material[painted].tolist())
    return np.where(painted, NO_MATERIAL, face_material).astype(np.int32), dict(names)


def appearance_of(
    materials: Sequence[Material], face_material: IntArray, uv: FloatArray | None, normals: Float32Array | None
) -> Appearance | None:
    """Return the look of faces, or None if it holds nothing but the colours of faces.

    uv: (f, 3, 2), those of faces without texture count for nothing
    normals: unit, (f, 3, 3)
    """
    used = {number for number in np.unique(face_material).tolist() if number != NO_MATERIAL}
    if not any(materials[number].textures for number in used):
        uv = None
    if not used and normals is None:
        return None
    return Appearance(
        tuple(materials),
        face_material.astype(np.int32),
        None if uv is None else np.nan_to_num(uv, posinf=0.0, neginf=0.0).astype(np.float32),
        normals,
    )
