"""Read pictures of drawings: every part of the project that takes a drawing reads it here."""

from __future__ import annotations

import io
import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.errors import ConfigError
from stages.model_files.limits import ReadLimits
from stages.model_files.read import read_bounded
from stages.recovery.inputs import MIN_INK_CONTRAST
from stages.shape.arrays import ByteArray
from stages.shape.input_file import FIRST_BYTES, check_first_bytes, check_input_file

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".webp", ".tif", ".tiff", ".gif")
PICTURE_FORMATS = ("PNG", "JPEG", "BMP", "WEBP", "TIFF", "GIF")
"""Formats that Pillow may try, whatever the file is called; for some others it starts programs."""
UNREAD_SUFFIXES = (".svg", ".svgz", ".pdf", ".heic", ".heif", ".avif", ".eps", ".ps", ".ai", ".psd", ".dxf", ".dwg")
"""Formats of drawings that are not read."""
MAX_DRAWING_SIDE_PIXELS = 8192
_OTHER_FORMATS = (
    ("a PDF", re.compile(rb"\s*%PDF")),
    ("PostScript", re.compile(rb"\s*%!PS|\xc5\xd0\xd3\xc6")),
    ("an SVG", re.compile(rb"(\xef\xbb\xbf)?(\s+|<\?xml[^>]*>|<!--.*?-->|<!DOCTYPE\s+svg[^>]*>)*<svg\b", re.DOTALL)),
    ("HEIC", re.compile(rb"....ftyp(hei|hev|mif1|msf1)", re.DOTALL)),
    ("AVIF", re.compile(rb"....ftypavi", re.DOTALL)),
    ("a Photoshop file", re.compile(rb"8BPS")),
    ("an AutoCAD file", re.compile(rb"AC10\d\d")),
)
_WHOLE_RANGES = (1, 255, 1023, 4095, 65535)
"""Brightness of white, by the bits of a camera or a scanner."""


@dataclass(frozen=True)
class Drawing:
    """A picture as a viewer shows it.

    pixels: uint8 (h, w, 3), upright, on white where it is transparent, or on black if its lines are white
    warnings: a sentence each
    """

    pixels: ByteArray
    warnings: tuple[str, ...]


def read_drawing(path: Path, limits: ReadLimits | None = None) -> Drawing:
    """Read a picture in a child process with limits.

    It is turned as its EXIF orientation says, 16 bits are scaled to 8, and the first page is taken of several. Raises
    ConfigError, with the remedy, for other formats, damaged files and more than MAX_DRAWING_SIDE_PIXELS a side.
    """
    check_input_file(path)

    def read() -> bytes:
        with open(path, "rb") as stream:
            drawing = parse_drawing(stream.read(), str(path))
        packed = io.BytesIO()
        np.savez(packed, pixels=drawing.pixels, warnings=np.frombuffer(json.dumps(drawing.warnings).encode(), np.uint8))
        return packed.getvalue()

    with np.load(io.BytesIO(read_bounded(path, read, limits or ReadLimits())), allow_pickle=False) as stored:
        return Drawing(stored["pixels"], tuple(json.loads(stored["warnings"].tobytes())))


def parse_drawing(content: bytes, name: str) -> Drawing:
    """`read_drawing` of a content, in the calling process; `name` begins the messages."""
    from PIL import Image, ImageOps, UnidentifiedImageError

    check_first_bytes(name, content[:FIRST_BYTES])
    limit = f"{MAX_DRAWING_SIDE_PIXELS:,}"
    try:
        with Image.open(io.BytesIO(content), formats=PICTURE_FORMATS) as image:
            if max(image.size) > MAX_DRAWING_SIDE_PIXELS:
                size = " × ".join(f"{side:,}" for side in image.size)
                raise ConfigError(f"{name} has {size} pixels: a drawing has at most {limit} a side; shrink it")
            pages = getattr(image, "n_frames", 1)
            pixels = _on_plain_background(ImageOps.exif_transpose(image))
    except ConfigError:
        raise
    except UnidentifiedImageError:
        raise ConfigError(f"{name} is no picture{_other_format(content)}") from None
    except Image.DecompressionBombError:
        raise ConfigError(f"{name} has too many pixels: shrink it to {limit} a side") from None
    except Exception:  # Pillow's readers raise anything for a damaged file
        raise ConfigError(f"{name} is no picture: it is cut off or damaged") from None
    warnings = (f"the picture has {pages:,} pages or frames: the first is taken",) if pages > 1 else ()
    return Drawing(pixels, warnings)


def _on_plain_background(image: Any) -> ByteArray:
    """Return the picture, uint8 (h, w, 3), on white where it is transparent; on black if nothing shows on white."""
    from PIL import Image

    if image.mode in ("I", "F") or image.mode.startswith("I;"):
        grey = np.nan_to_num(np.asarray(image, dtype=np.float64))
        highest = float(grey.max(initial=0.0))
        white = next((white for white in _WHOLE_RANGES if highest <= white), highest)
        return np.repeat(np.rint(np.clip(grey / white, 0.0, 1.0) * 255).astype(np.uint8)[..., None], 3, axis=2)
    layer = image.convert("RGBA")
    pictures = (
        np.asarray(Image.alpha_composite(Image.new("RGBA", layer.size, background), layer).convert("RGB"))
        for background in ("white", "black")
    )
    on_white: ByteArray = next(pictures)
    return on_white if int(np.ptp(on_white)) >= MIN_INK_CONTRAST else next(pictures)


def _other_format(content: bytes) -> str:
    """Return what a content is that is no picture of PICTURE_FORMATS, as the end of a sentence."""
    for other, first in _OTHER_FORMATS:
        if first.match(content[:FIRST_BYTES]):
            return f" of {', '.join(PICTURE_FORMATS)} but {other}; export it as PNG"
    return f": none of {', '.join(PICTURE_FORMATS)}"
