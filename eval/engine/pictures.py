"""Small pictures of shapes and point clouds for the report."""

from __future__ import annotations

import numpy as np

from stages.shape.arrays import ByteArray, FloatArray
from stages.shape.shape import Shape
from stages.shape.views.picture import ABOVE

PICTURE_SIZE = (264, 264)


def rendered_png(shape: Shape) -> bytes:
    """Render a shape as PNG."""
    from stages.shape.views.sheet import picture_png

    return picture_png(shape_portrait(shape))


def shape_portrait(shape: Shape) -> ByteArray:
    """Render a shape, uint8 (h, w, 3). Parts get distinct colours if the model has none."""
    from stages.shape.views.part_colors import part_paint
    from stages.shape.views.portrait import portrait
    from stages.shape.views.scene import scene_of

    return portrait(scene_of(shape), ABOVE, PICTURE_SIZE, part_paint(shape))


def cloud_picture(points: FloatArray) -> bytes:
    """Render a cloud (n, 3), y up, as PNG."""
    from stages.shape.views.sheet import picture_png

    return picture_png(cloud_portrait(points))


def cloud_portrait(points: FloatArray) -> ByteArray:
    """Render a cloud (n, 3), y up, uint8 (h, w, 3)."""
    from stages.shape.views.portrait import points_portrait

    return points_portrait(points, np.zeros(len(points), np.int32), ABOVE, PICTURE_SIZE, "y")
