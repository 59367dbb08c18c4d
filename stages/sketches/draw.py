"""One line drawing of a scene."""

from __future__ import annotations

import numpy as np

from pipeline.errors import ShardFailed
from stages.shape.arrays import ByteArray
from stages.shape.views.buffers import RendererName, Visible, visible_triangles
from stages.shape.views.camera import Camera, View
from stages.shape.views.scene import Scene
from stages.sketches.settings import SketchView, StrokeOptions


def jittered_camera(view: SketchView, rng: np.random.Generator) -> Camera:
    """Return the camera of a view for one sample; jitters are drawn uniformly from `rng` in a fixed order."""
    azimuth, elevation, fov, distance = rng.uniform(-1.0, 1.0, 4).tolist()
    return Camera(
        azimuth=view.azimuth + azimuth * view.azimuth_jitter,
        elevation=view.elevation + elevation * view.elevation_jitter,
        projection=view.projection,
        fov=view.fov + fov * view.fov_jitter,
        distance=None if view.distance is None else view.distance * (1.0 + distance * view.distance_jitter),
        margin=view.margin,
    )


def draw_sketch(
    scene: Scene, camera: Camera, size: int, supersample: int, options: StrokeOptions, renderer: RendererName
) -> tuple[ByteArray, View]:
    """Return dark lines on white, uint8 (size, size), and the view that they show.

    Raises ShardFailed if nothing is seen or drawn: a blank drawing is never a sample.
    """
    seen = visible_triangles(scene, camera, (size * supersample, size * supersample), renderer)
    drawing = draw_visible(seen, supersample, options)
    if drawing.min() == drawing.max():
        raise ShardFailed(f"blank drawing: no line of {len(scene)} parts is seen from {camera}")
    return drawing, seen.view


def draw_visible(seen: Visible, supersample: int, options: StrokeOptions) -> ByteArray:
    """Return dark lines on white, uint8 (h, w), of a view with `supersample` samples to a pixel in x and y."""
    from stages.shape.views.ink import ink_strokes
    from stages.shape.views.strokes import BOUNDARY_LINE, CONTOUR_LINE, CREASE_LINE, OUTLINE_LINE, find_strokes

    height, width = (length // supersample for length in seen.triangles.shape)
    strokes = find_strokes(seen, options.crease_angle, options.step * supersample, options.shortest * supersample)
    widths = {
        OUTLINE_LINE: options.outline,
        CONTOUR_LINE: options.contour,
        BOUNDARY_LINE: options.boundary,
        CREASE_LINE: options.crease,
    }
    ink = ink_strokes(strokes, widths, width, height, 1.0 / supersample, options.crowding)
    return np.rint(255.0 * (1.0 - options.ink * ink)).astype(np.uint8)
