"""Face colours: sRGB bytes from material factors, textures and vertex colours."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping

import numpy as np

from stages.shape.appearance import Wrap
from stages.shape.arrays import ByteArray, FloatArray, IntArray
from stages.shape.input_file import content_fault

IMAGE_FORMATS = ("PNG", "JPEG", "WEBP", "BMP", "GIF", "TGA", "TIFF", "DDS", "PPM")
"""The formats that are tried, whatever the file's name: for others Pillow starts programs (EPS) or runs long."""

_WRAPS: Mapping[Wrap, Callable[[FloatArray], FloatArray]] = {
    "repeat": lambda at: at % 1.0,
    "mirror": lambda at: 1.0 - np.abs(1.0 - at % 2.0),
    "clamp": lambda at: np.clip(at, 0.0, 1.0),
}
MAX_ROUNDING = 1.001
"""Factor by which colours exceed their range through rounding."""


def linear_from_srgb(colors: ByteArray) -> FloatArray:
    """Convert sRGB bytes to linear intensities in [0, 1] (IEC 61966-2-1)."""
    value = colors / 255.0
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def srgb_from_linear(linear: FloatArray) -> ByteArray:
    """Convert linear intensities to sRGB bytes (IEC 61966-2-1)."""
    value = np.clip(linear, 0.0, 1.0)
    return color_bytes(np.where(value <= 0.0031308, value * 12.92, 1.055 * value ** (1 / 2.4) - 0.055))


def color_bytes(colors: FloatArray) -> ByteArray:
    """Round values in [0, 1] to bytes."""
    return np.rint(np.clip(np.nan_to_num(colors), 0.0, 1.0) * 255).astype(np.uint8)


def unit_colors(colors: np.ndarray) -> FloatArray:
    """Return red, green and blue of all `colors` (n, 3 or 4) of a file in [0, 1].

    Bytes range to 255. Wider numbers range to the least of 255, 65,535 and the largest number of their type that none
    of them exceeds; floats also to 1. Bytes with a sign are bytes that were written without asking for one.
    """
    rgb = np.asarray(colors)[:, :3]
    if rgb.dtype.itemsize == 1:
        return rgb.view(np.uint8) / 255.0
    values = np.nan_to_num(rgb.astype(np.float64))
    limits = [255.0, 65535.0, float(np.iinfo(rgb.dtype).max) if rgb.dtype.kind in "ui" else np.inf]
    if rgb.dtype.kind == "f":
        limits.insert(0, 1.0)
    largest = values.max(initial=0.0) / MAX_ROUNDING
    limit = next(limit for limit in limits if largest <= limit)
    return values / (limit if np.isfinite(limit) else max(largest, 1.0))


def wrap_coordinates(uv: FloatArray, wrap_u: Wrap, wrap_v: Wrap) -> FloatArray:
    """Return texture coordinates (n, 2) in [0, 1), or up to 1 where they are clamped."""
    return np.stack([_WRAPS[wrap](np.nan_to_num(uv[:, axis])) for axis, wrap in enumerate((wrap_u, wrap_v))], axis=1)


def decode_image(content: bytes) -> ByteArray:
    """Return the pixels of an image file, uint8 (h, w, 3), first row at the top, or (h, w, 4) if it is not opaque.

    Raises OSError for other formats.
    """
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(io.BytesIO(content), formats=IMAGE_FORMATS) as image:
            if not image.has_transparency_data:
                return np.asarray(image.convert("RGB"))
            pixels = np.asarray(image.convert("RGBA"))
            return np.ascontiguousarray(pixels[:, :, :3]) if (pixels[:, :, 3] == 255).all() else pixels
    except Image.DecompressionBombError:
        raise OSError(f"it has more than {2 * (Image.MAX_IMAGE_PIXELS or 0):,} pixels") from None
    except UnidentifiedImageError:
        if other := content_fault(content):
            raise OSError(f"it {other}") from None
        raise OSError(f"it is not one of {', '.join(IMAGE_FORMATS)}") from None
    except OSError:
        raise
    except Exception:  # for a damaged file Pillow's readers raise any exception
        raise OSError("it is damaged") from None


def sample_texture(
    image: ByteArray, uv: FloatArray, faces: IntArray, wrap_u: Wrap = "repeat", wrap_v: Wrap = "repeat"
) -> ByteArray:
    """Return the colour of `image` (h, w, 3 or 4) under the centroid of each face, uint8 (f, 3).

    uv: float64 (n, 2), origin at the lower left of the image.
    faces: int32 (f, 3), indices into uv.
    wrap_u, wrap_v: what is outside [0, 1].
    """
    height, width = image.shape[:2]
    middle = uv[faces].mean(axis=1)
    column, row = (wrap_coordinates(middle * (1.0, -1.0) + (0.0, 1.0), wrap_u, wrap_v) * (width, height)).T
    column, row = np.floor(column).astype(np.int64), np.floor(row).astype(np.int64)
    pixels: ByteArray = image[np.minimum(row, height - 1), np.minimum(column, width - 1), :3]
    return pixels


def face_paint(vertex_colors: ByteArray, faces: IntArray) -> ByteArray:
    """Return one of the vertex colours (n, 3) for each face: the commonest of its three, else the first."""
    first, second, third = vertex_colors[faces].transpose(1, 0, 2)
    paint: ByteArray = np.where((second == third).all(axis=1)[:, None], second, first)
    return paint
