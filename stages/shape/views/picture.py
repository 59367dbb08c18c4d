"""A picture of one shape."""

from __future__ import annotations

from stages.shape.shape import Shape
from stages.shape.views.camera import Camera
from stages.shape.views.portrait import portrait
from stages.shape.views.scene import scene_of
from stages.shape.views.sheet import picture_png

ABOVE = Camera(azimuth=-40.0, elevation=25.0)


def shape_png(shape: Shape, camera: Camera = ABOVE, size: tuple[int, int] = (640, 640)) -> bytes:
    """Return a shaded picture of `shape` as PNG, by default from the left and above.

    size: (width, height) in pixels

    Raises ShardFailed for a shape that is not visible.
    """
    return picture_png(portrait(scene_of(shape), camera, size))
