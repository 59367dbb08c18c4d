"""Pictures for the report: small portraits."""

from __future__ import annotations

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.shape import Shape
from stages.shape.views.picture import ABOVE

__all__ = ["cloud_picture", "shape_picture"]

SIZE = (264, 264)


def shape_picture(shape: Shape) -> bytes:
    """A portrait of a shape as PNG, its parts told by colour where its model tells them by none."""
    from stages.shape.views.paint import part_paint
    from stages.shape.views.portrait import portrait
    from stages.shape.views.scene import scene_of
    from stages.shape.views.sheet import picture_png

    return picture_png(portrait(scene_of(shape), ABOVE, SIZE, part_paint(shape)))


def cloud_picture(points: FloatArray) -> bytes:
    """A portrait of a cloud (n, 3), y up, as PNG."""
    from stages.shape.views.portrait import points_portrait
    from stages.shape.views.sheet import picture_png

    return picture_png(points_portrait(points, np.zeros(len(points), np.int32), ABOVE, SIZE, "y"))
