"""Face colours: sRGB bytes from material factors, textures and vertex colours."""

from __future__ import annotations

import io

import numpy as np

from stages.shape.arrays import ByteArray, FloatArray, IntArray

IMAGE_FORMATS = ("PNG", "JPEG", "WEBP", "BMP", "GIF", "TGA", "TIFF", "DDS", "PPM")
"""The formats that are tried, whatever the file's name: for others Pillow starts programs (EPS) or runs long."""


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
    """Return red, green and blue of `colors` (n, 3 or 4), floats or whole numbers, in [0, 1]."""
    rgb = np.asarray(colors)[:, :3]
    if rgb.dtype.kind in "ui":
        return rgb / float(np.iinfo(rgb.dtype).max)
    return rgb.astype(np.float64)


def decode_image(content: bytes) -> ByteArray:
    """Return the pixels of an image file, uint8 (h, w, 3), first row at the top. Raises OSError for other formats."""
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(io.BytesIO(content), formats=IMAGE_FORMATS) as image:
            return np.asarray(image.convert("RGB"))
    except Image.DecompressionBombError:
        raise OSError(f"it has more than {2 * (Image.MAX_IMAGE_PIXELS or 0):,} pixels") from None
    except UnidentifiedImageError:
        raise OSError(f"it is not one of {', '.join(IMAGE_FORMATS)}") from None
    except OSError:
        raise
    except Exception:  # for a damaged file Pillow's readers raise any exception
        raise OSError("it is damaged") from None


def sample_texture(image: ByteArray, uv: FloatArray, faces: IntArray) -> ByteArray:
    """Return the pixel of `image` (h, w, 3) under the centroid of each face, uint8 (f, 3).

    uv: float64 (n, 2), origin at the lower left of the image, repeating outside [0, 1].
    faces: int32 (f, 3), indices into uv.
    """
    height, width = image.shape[:2]
    centroid = np.nan_to_num(uv[faces].mean(axis=1))
    column = np.floor((centroid[:, 0] % 1.0) * width).astype(np.int64)
    row = np.floor(((1.0 - centroid[:, 1]) % 1.0) * height).astype(np.int64)
    pixels: ByteArray = image[np.minimum(row, height - 1), np.minimum(column, width - 1)]
    return pixels


def face_paint(vertex_colors: ByteArray, faces: IntArray) -> ByteArray:
    """Return one of the vertex colours (n, 3) for each face: the commonest of its three, else the first."""
    first, second, third = vertex_colors[faces].transpose(1, 0, 2)
    paint: ByteArray = np.where((second == third).all(axis=1)[:, None], second, first)
    return paint
