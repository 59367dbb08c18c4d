"""Augmentations of drawings, by OpenImageIO."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pipeline.errors import ShardFailed
from stages.shape.arrays import ByteArray
from stages.sketches.settings import Augmentation


class Augmented(NamedTuple):
    """A changed drawing.

    drawing: uint8 (h, w)
    flipped: whether it is mirrored
    thicker: pixels by which its lines have grown wider at most
    """

    drawing: ByteArray
    flipped: bool
    thicker: int


def augment(drawing: ByteArray, chances: Augmentation, rng: np.random.Generator) -> Augmented:
    """Return the drawing (h, w), mirrored, thickened or thinned with the given chances; always two draws from `rng`."""
    mirror, morphology = rng.random(2)
    flipped, thicker = bool(mirror < chances.flip), 0
    if flipped:
        drawing = flip(drawing)
    if morphology < chances.dilate:
        drawing, thicker = dilate(drawing, chances.size), chances.size - 1
    elif morphology < chances.dilate + chances.erode:
        drawing = erode(drawing, chances.size)
    return Augmented(drawing, flipped, thicker)


def flip(drawing: ByteArray) -> ByteArray:
    """Mirror left and right."""
    return np.ascontiguousarray(drawing[:, ::-1])


def dilate(drawing: ByteArray, size: int) -> ByteArray:
    """Thicken lines: each pixel gets the darkest value in the square of side `size` around it."""
    import OpenImageIO as oiio

    return _pixels(oiio.ImageBufAlgo.erode(_buffer(drawing), size, size))


def erode(drawing: ByteArray, size: int) -> ByteArray:
    """Thin lines: each pixel gets the lightest value in the square of side `size` around it."""
    import OpenImageIO as oiio

    return _pixels(oiio.ImageBufAlgo.dilate(_buffer(drawing), size, size))


def _buffer(drawing: ByteArray) -> Any:
    import OpenImageIO as oiio

    return oiio.ImageBuf(np.ascontiguousarray(drawing)[:, :, None])


def _pixels(buffer: Any) -> ByteArray:
    import OpenImageIO as oiio

    if buffer.has_error:
        raise ShardFailed(f"OpenImageIO: {buffer.geterror()}")
    return np.ascontiguousarray(buffer.get_pixels(oiio.UINT8)[:, :, 0])
