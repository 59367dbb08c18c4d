"""Colours for part types, labels and samples that have none, and of the paper that they are drawn on."""

from __future__ import annotations

import numpy as np

from stages.shape.arrays import ByteArray, FloatArray

PAPER = (250, 248, 244)
"""Background of pictures, sRGB: a warm near-white."""
GOLDEN_TURN = 0.3819660112501051
LIGHTNESS = (0.76, 0.84, 0.66)
CHROMA = (0.088, 0.072, 0.100)


def label_colors(count: int) -> ByteArray:
    """Return `count` soft colours that are easy to tell apart, uint8 (count, 3) sRGB.

    They are evenly light, with hues a golden turn apart. A colour depends only on its index, so label 3 looks the same
    in every picture.
    """
    index = np.arange(count)
    hue = 2.0 * np.pi * (0.09 + index * GOLDEN_TURN)
    tier = index // 9 % len(LIGHTNESS)
    lightness, chroma = np.array(LIGHTNESS)[tier], np.array(CHROMA)[tier]
    a, b = chroma * np.cos(hue), chroma * np.sin(hue)
    # OKLab to linear sRGB, by the matrices of its definition.
    long = (lightness + 0.3963377774 * a + 0.2158037573 * b) ** 3
    medium = (lightness - 0.1055613458 * a - 0.0638541728 * b) ** 3
    short = (lightness - 0.0894841775 * a - 1.2914855480 * b) ** 3
    red = 4.0767416621 * long - 3.3077115913 * medium + 0.2309699292 * short
    green = -1.2684380046 * long + 2.6097574011 * medium - 0.3413193965 * short
    blue = -0.0041960863 * long - 0.7034186147 * medium + 1.7076147010 * short
    return linear_to_srgb(np.stack([red, green, blue], axis=-1))


def srgb_to_linear(color: ByteArray) -> FloatArray:
    """Convert uint8 sRGB to linear light 0..1."""
    value = color / 255.0
    linear: FloatArray = np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)
    return linear


def linear_to_srgb(light: FloatArray) -> ByteArray:
    """Convert linear light to uint8 sRGB, clipped to white."""
    value = np.clip(light, 0.0, 1.0)
    encoded = np.where(value <= 0.0031308, 12.92 * value, 1.055 * value ** (1 / 2.4) - 0.055)
    return np.rint(255.0 * encoded).astype(np.uint8)
