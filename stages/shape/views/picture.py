"""A picture of one shape, for whoever wants to see what they have made."""

from __future__ import annotations

from stages.shape.shape import Shape
from stages.shape.views.camera import Camera
from stages.shape.views.portrait import portrait
from stages.shape.views.scene import scene_of
from stages.shape.views.sheet import picture_png

ABOVE = Camera(azimuth=-40.0, elevation=25.0)


def shape_png(shape: Shape, camera: Camera = ABOVE, size: tuple[int, int] = (640, 640)) -> bytes:
    """A shaded picture of `shape` as PNG, of `size` (width, height) in pixels, from the left and above unless `camera`
    says otherwise. Raises ShardFailed for a shape of which nothing is seen."""
    return picture_png(portrait(scene_of(shape), camera, size))
