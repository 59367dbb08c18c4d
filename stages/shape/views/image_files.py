"""Pictures as files: PNG, JPEG, WebP and EXR, with pinned settings; equal pixels give equal bytes.

OpenImageIO writes them, except WebP: it has no key for the effort of WebP's search, and with transparency it takes 60
times as long as Pillow.
"""

from __future__ import annotations

import io
import tempfile
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from pipeline.errors import ShardFailed
from stages.shape.arrays import ByteArray, Float32Array

PNG_LEVEL = 4
"""Effort of compression: 6 takes up to half as long again and saves a tenth (`python -m tests.bench views`)."""
FILTER_NONE, FILTER_UP = 8, 32
"""Filters of rows, as libpng numbers them: none, and the difference to the row above.

Each is the smallest for its kind of image, in half the time of libpng's choice row by row.
"""
WEBP_EFFORT = 2
EXR_TIME = "1970:01:01 00:00:00"
"""Time in an EXR's header, which OpenImageIO would take from the clock."""
EXR_COMPRESSION = "zip"
"""Lossless, and every reader knows it; pxr24 is half as large, and some readers do not know it."""

ChannelType = Literal["half", "float"]


def png_bytes(drawing: ByteArray) -> bytes:
    """Return a drawing, uint8 (h, w), as a single-channel 8-bit PNG."""
    attributes = {"png:compressionLevel": PNG_LEVEL, "png:filter": FILTER_NONE}
    return _written(drawing, "png", "uint8", attributes)


def color_png_bytes(pixels: ByteArray, level: int = PNG_LEVEL) -> bytes:
    """Return sRGB colours, uint8 (h, w, 3), or (h, w, 4) with alpha not multiplied in, as an 8-bit PNG.

    level: effort of compression, 1 to 9
    """
    attributes = {"png:compressionLevel": level, "png:filter": FILTER_NONE, "oiio:UnassociatedAlpha": 1}
    return _written(pixels, "png", "uint8", attributes)


def data_png_bytes(pixels: npt.NDArray[Any], smooth: bool = False, level: int = PNG_LEVEL) -> bytes:
    """Return numbers that are no colours, uint8 or uint16 (h, w) or (h, w, 3), as a PNG of as many bits.

    smooth: whether neighbours mostly differ a little, as depths do
    level: effort of compression, 1 to 9
    """
    attributes = {"png:compressionLevel": level, "png:filter": FILTER_UP if smooth else FILTER_NONE}
    return _written(pixels, "png", str(pixels.dtype), {**attributes, "oiio:ColorSpace": "raw"})


def jpeg_bytes(pixels: ByteArray, quality: int) -> bytes:
    """Return colours, uint8 (h, w, 3), as a JPEG of a quality from 1 to 100."""
    return _written(pixels, "jpg", "uint8", {"Compression": f"jpeg:{quality}", "jpeg:subsampling": "4:2:0"})


def webp_bytes(pixels: ByteArray, quality: int) -> bytes:
    """Return colours, uint8 (h, w, 3) or (h, w, 4), as a lossy WebP of a quality from 1 to 100."""
    from PIL import Image

    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, "WEBP", quality=quality, method=WEBP_EFFORT)
    return stream.getvalue()


def exr_bytes(channels: Mapping[str, tuple[Float32Array, ChannelType]], compression: str = EXR_COMPRESSION) -> bytes:
    """Return named channels, float32 (h, w) each, as an EXR that holds each in the type given.

    compression: a codec of EXR, as OpenImageIO names it
    """
    pixels = np.stack([channel for channel, _ in channels.values()], axis=-1)
    attributes = {"compression": compression, "DateTime": EXR_TIME}
    types = [kind for _, kind in channels.values()]
    return _written(pixels, "exr", types[0], attributes, list(channels), types)


def read_exr(content: bytes) -> dict[str, Float32Array]:
    """Return the channels of an EXR by name, float32 (h, w) each. Raises ValueError for bytes that are no EXR."""
    import OpenImageIO as oiio

    path = Path(_folder().name) / "read.exr"
    path.write_bytes(content)
    source = oiio.ImageInput.open(str(path))
    if source is None:
        raise ValueError(f"it is no EXR: {oiio.geterror()}")
    pixels = source.read_image("float")
    names = list(source.spec().channelnames)
    source.close()
    if pixels is None:
        raise ValueError(f"it is an incomplete EXR: {source.geterror()}")
    return {name: np.ascontiguousarray(pixels[:, :, number]) for number, name in enumerate(names)}


def _written(
    pixels: npt.NDArray[Any],
    suffix: str,
    kind: str,
    attributes: Mapping[str, Any],
    names: Sequence[str] = (),
    types: Sequence[str] = (),
) -> bytes:
    """Write pixels (h, w) or (h, w, c) with OpenImageIO. Raises ShardFailed where it cannot."""
    import OpenImageIO as oiio

    planes = np.ascontiguousarray(pixels if pixels.ndim == 3 else pixels[:, :, None])
    height, width, count = planes.shape
    spec = oiio.ImageSpec(width, height, count, kind)
    for name, value in attributes.items():
        spec.attribute(name, value)
    if names:
        spec.channelnames = tuple(names)
    if len(set(types)) > 1:
        spec.channelformats = tuple(oiio.TypeDesc(kind) for kind in types)
    path = Path(_folder().name) / f"picture.{suffix}"
    output = oiio.ImageOutput.create(str(path))
    if output is None:
        raise ShardFailed(f"OpenImageIO cannot write {suffix}: {oiio.geterror()}")
    written = output.open(str(path), spec) and output.write_image(planes)
    if not (output.close() and written):
        raise ShardFailed(f"OpenImageIO cannot write {suffix}: {output.geterror()}")
    return path.read_bytes()


@cache
def _folder() -> tempfile.TemporaryDirectory[str]:
    """Return this process's folder for files: OpenImageIO writes and reads nothing else."""
    return tempfile.TemporaryDirectory()
