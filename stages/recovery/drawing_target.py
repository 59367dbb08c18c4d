"""A line drawing as the target of a search."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from stages.programs.curves.part import Part
from stages.programs.program import Program
from stages.shape.arrays import BoolArray, FloatArray
from stages.shape.views.camera import Camera
from stages.sketches.draw import jittered_camera
from stages.sketches.settings import SketchesConfig, SketchView
from stages.training.recovery.drawings import DRAWING_SIDE_PIXELS, draw_fitted

FIRST_CAMERA_STEP_DEGREES = 16.0
"""The step is halved at each alignment."""
MIN_CAMERA_STEP_DEGREES = 1.0


@dataclass(frozen=True)
class DrawingTarget:
    """The lines of a drawing, compared with shapes drawn from a view.

    program, config: shapes of the program are drawn as stage `sketches` draws them by the config
    view: from where
    step: degrees by which the camera moves at an alignment; 0 before the first
    ink: bool (side, side)
    squared_distances: float64 (side, side), of each pixel to the ink, in sides
    """

    program: Program
    config: SketchesConfig
    view: SketchView
    step: float
    ink: BoolArray
    squared_distances: FloatArray

    @property
    def camera(self) -> Camera:
        """The camera of the view, without jitter."""
        return jittered_camera(self.view, np.random.default_rng(0))

    def compared(self, parts: Sequence[Part]) -> tuple[float, DrawingTarget]:
        lines = draw_fitted(self.program, tuple(parts), self.view, self.config, np.random.default_rng(0))
        return float(self.squared_distances[lines].mean() + _squared_distances(lines)[self.ink].mean()), self

    def floor(self, parts: Sequence[Part], rng: np.random.Generator) -> float:
        return 0.0

    def aligned(self, parts: Sequence[Part]) -> DrawingTarget:
        """Look from the view whose lines are nearest.

        The first two alignments try the views of the config and views all around. Later ones try views next to the
        present one, closer each time.
        """
        step = self.step / 2.0 if self.step else FIRST_CAMERA_STEP_DEGREES
        if step < MIN_CAMERA_STEP_DEGREES:
            return self
        moves = ((0.0, 0.0), (step, 0.0), (-step, 0.0), (0.0, step), (0.0, -step))
        views = [_moved(self.view, *move) for move in moves if self.step]
        if step >= FIRST_CAMERA_STEP_DEGREES / 2.0:
            views += [*map(_without_jitter, self.config.views), *_views_around(self.program)]
        candidates = [replace(self, view=view, step=step) for view in views]
        return min(candidates, key=lambda candidate: candidate.compared(parts)[0])


def drawing_target(program: Program, config: SketchesConfig, ink: BoolArray) -> DrawingTarget:
    """Make the target of fitted ink (side, side). It is not aligned yet."""
    # Lines are located, not each pixel of them: no supersampling.
    fast = config.model_copy(update={"supersample": 1, "size": DRAWING_SIDE_PIXELS})
    return DrawingTarget(program, fast, _without_jitter(config.views[0]), 0.0, ink, _squared_distances(ink))


def _views_around(program: Program) -> Iterator[SketchView]:
    """Views that people draw from: front and both sides, slightly to well above (below for hanging shapes)."""
    for azimuth, elevation in product((-55.0, -35.0, -15.0, 0.0, 15.0, 35.0, 55.0), (12.0, 30.0, 50.0)):
        yield SketchView(azimuth=azimuth, elevation=elevation if program.view_elevation > 0 else -elevation)


def _moved(view: SketchView, azimuth: float, elevation: float) -> SketchView:
    clipped = min(max(view.elevation + elevation, -90.0), 90.0)
    return view.model_copy(update={"azimuth": view.azimuth + azimuth, "elevation": clipped})


def _without_jitter(view: SketchView) -> SketchView:
    return view.model_copy(
        update=dict.fromkeys(("azimuth_jitter", "elevation_jitter", "fov_jitter", "distance_jitter"), 0.0)
    )


def _squared_distances(ink: BoolArray) -> FloatArray:
    from scipy.ndimage import distance_transform_edt

    squared: FloatArray = (distance_transform_edt(~ink) / DRAWING_SIDE_PIXELS) ** 2
    return squared
