"""Drawings as a network sees them: ink fitted to a square."""

from __future__ import annotations

import numpy as np

from stages.programs.curves.part import Part
from stages.programs.program import Program, shape_from_parts
from stages.shape.arrays import BoolArray, ByteArray
from stages.shape.views.scene import scene_of
from stages.sketches.draw import draw_sketch, jittered_camera
from stages.sketches.settings import SketchesConfig, SketchView

DRAWING_SIDE_PIXELS = 224
MARGIN_PIXELS = 8
"""Free around the ink."""
INK_THRESHOLD = 128
"""A darker pixel is ink."""


def fit_to_square(ink: BoolArray) -> BoolArray:
    """Fit ink (h, w) of any size into the middle of a square, bool (side, side).

    A pixel is ink where any pixel that it covers is, and lines of small drawings stay whole. Raises ValueError without
    ink.
    """
    rows, columns = np.nonzero(ink)
    if not len(rows):
        raise ValueError("a drawing without a line")
    height, width = np.ptp(rows) + 1, np.ptp(columns) + 1
    scale = (DRAWING_SIDE_PIXELS - 2 * MARGIN_PIXELS) / max(height, width)
    if scale > 1.0:
        # each pixel of a small drawing is a square of the large one
        grown = int(np.ceil(scale))
        ink = np.repeat(np.repeat(ink[rows.min() :, columns.min() :][:height, :width], grown, axis=0), grown, axis=1)
        rows, columns = np.nonzero(ink)
        scale /= grown
    else:
        rows, columns = rows - rows.min(), columns - columns.min()
    down, across = (DRAWING_SIDE_PIXELS - scale * ink_size for ink_size in (rows.max() + 1, columns.max() + 1))
    square = np.zeros((DRAWING_SIDE_PIXELS, DRAWING_SIDE_PIXELS), dtype=np.bool_)
    square[(rows * scale + down / 2).astype(int), (columns * scale + across / 2).astype(int)] = True
    return square


def draw_fitted(
    program: Program, parts: tuple[Part, ...], view: SketchView, config: SketchesConfig, rng: np.random.Generator
) -> BoolArray:
    """Draw a shape as stage `sketches` does, bool (side, side), fitted."""
    scene = scene_of(shape_from_parts(program, parts))
    camera = jittered_camera(view, rng)
    drawing: ByteArray
    drawing, _ = draw_sketch(scene, camera, config.size, config.supersample, config.strokes, config.renderer)
    return fit_to_square(drawing < INK_THRESHOLD)
