"""Depth, normals and ids as the numbers of files, and back.

Numba compiles this module when it is imported: import it inside functions.
"""

from __future__ import annotations

import numba
import numpy as np

from stages.shape.arrays import ByteArray, Float32Array

DEPTH_LEVELS = 65_535
SPARE_BITS = 7
"""Bits of a 32-bit depth that are rounded away: 16 of its mantissa stay, and the file is a sixth as long."""


def depth_scale(depth: Float32Array) -> float:
    """Return the length of a level of a 16-bit depth image, with nine digits."""
    return float(f"{float(depth.max()) / DEPTH_LEVELS:.9g}")


def depth_levels(depth: Float32Array, scale: float) -> np.ndarray:
    """Return depth in levels of `scale`, uint16 (h, w); 0 where nothing is seen."""
    levels: np.ndarray = _levels(depth, scale)
    return levels


def rounded_depth(depth: Float32Array) -> Float32Array:
    """Return depth (h, w) with 16 bits of its mantissa: an error of at most 8 millionths of it."""
    half, kept = np.uint32(1 << (SPARE_BITS - 1)), np.uint32(0xFFFFFFFF << SPARE_BITS & 0xFFFFFFFF)
    return ((np.ascontiguousarray(depth).view(np.uint32) + half) & kept).view(np.float32)


def normal_bytes(normals: Float32Array) -> ByteArray:
    """Return unit normals (h, w, 3) as uint8: -1 is 0 and 1 is 255; black where nothing is seen."""
    encoded: ByteArray = _normals(normals)
    return encoded


def normals_of(encoded: ByteArray) -> Float32Array:
    """Return the unit normals of an image, float32 (h, w, 3), zero where it is black."""
    normals = encoded.astype(np.float32) / np.float32(127.5) - np.float32(1.0)
    normals[~encoded.any(axis=-1)] = 0.0
    return unit_length(normals)


def unit_length(normals: Float32Array) -> Float32Array:
    """Return normals (h, w, 3) without the error in length that a file's rounding leaves; zero stays zero."""
    lengths = np.linalg.norm(normals, axis=-1, keepdims=True)
    unit: Float32Array = np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0)
    return unit


@numba.njit(cache=True, error_model="numpy")
def _levels(depth, scale):
    height, width = depth.shape
    levels = np.zeros((height, width), dtype=np.uint16)
    for row in range(height):
        for column in range(width):
            if depth[row, column] > 0.0:
                levels[row, column] = min(max(int(np.float64(depth[row, column]) / scale + 0.5), 1), DEPTH_LEVELS)
    return levels


@numba.njit(cache=True, error_model="numpy")
def _normals(normals):
    height, width = normals.shape[:2]
    encoded = np.zeros((height, width, 3), dtype=np.uint8)
    for row in range(height):
        for column in range(width):
            n = normals[row, column]
            if n[0] != 0.0 or n[1] != 0.0 or n[2] != 0.0:
                for k in range(3):
                    encoded[row, column, k] = int((np.float64(n[k]) + 1.0) * 127.5 + 0.5)
    return encoded
