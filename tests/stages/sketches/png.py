"""Read the pixels of a PNG with OpenImageIO."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from stages.shape.arrays import ByteArray


def png_array(content: bytes) -> ByteArray:
    """Return the pixels uint8 (h, w) of a single-channel PNG. Raises ValueError for anything else."""
    import OpenImageIO as oiio

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "drawing.png"
        path.write_bytes(content)
        image = oiio.ImageInput.open(str(path))
        if image is None:
            raise ValueError(f"not an image: {oiio.geterror()}")
        spec = image.spec()
        pixels = image.read_image(oiio.UINT8)
        image.close()
    if spec.nchannels != 1:
        raise ValueError(f"the image has {spec.nchannels} channels instead of 1")
    drawing: ByteArray = np.asarray(pixels)[:, :, 0]
    return drawing
