"""What a shape is compared with while it is searched for: a cloud, or the lines of a drawing."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any, Protocol

import numpy as np

from stages.programs.curves.part import Part
from stages.programs.program import Program
from stages.shape.arrays import BoolArray, FloatArray
from stages.shape.views.camera import Camera
from stages.sketches.draw import jittered_camera
from stages.sketches.settings import SketchesConfig, SketchView
from stages.training.recovery.clouds import Frame, frame_of
from stages.training.recovery.drawings import DRAWING_SIDE_PIXELS, draw_fitted
from stages.training.recovery.surface import sample_points, shape_points

COMPARED = 1024
"""Points of each side that look for the nearest of the other."""
LOOKED_AT = 2048
"""Points of each side among which the nearest is looked for."""
ALIGNMENTS = 4
FIRST_STEP, LEAST_STEP = 16.0, 1.0
"""Degrees by which a camera is moved, halved each time."""


class RecoveryTarget(Protocol):
    """Something that shapes are compared with."""

    def compared(self, parts: Sequence[Part]) -> tuple[float, RecoveryTarget]:
        """How far a shape is from it, and the target as it was placed for that: the mean squared distance to the
        nearest, both ways, added. The unit is the longest side of the box around the target."""

    def aligned(self, parts: Sequence[Part]) -> RecoveryTarget:
        """The same target, placed so that it lies on a shape as well as may be."""

    def floor(self, parts: Sequence[Part], rng: np.random.Generator) -> float:
        """How far a shape is from a target of its own: as near as any input can be."""


@dataclass(frozen=True)
class CloudTarget:
    """A cloud that stands somewhere beside a program's shapes: `points` float64 (n, 3) in the box from -0.5 to 0.5, in
    random order, and `tree`, a search tree of them; `frame` puts them into the program's coordinates, where the shape
    that it was placed for has the box `box`."""

    points: FloatArray
    tree: Any
    frame: Frame
    box: Frame

    def compared(self, parts: Sequence[Part]) -> tuple[float, CloudTarget]:
        """Where it stands; and, if the shape's box is another than before, box on box. A cloud does not say how large
        a shape is: a parameter that makes it higher might as well make all others smaller."""
        surface = shape_points(parts, LOOKED_AT)
        box = frame_of(surface)
        places = [self.frame] if box.is_like(self.box) else [self.frame, box]
        distance, frame = min(((self._distance(surface, each), each) for each in places), key=lambda each: each[0])
        return distance, replace(self, frame=frame, box=box)

    def aligned(self, parts: Sequence[Part]) -> CloudTarget:
        """First box on box; then scale and place by which the pairs of nearest points lie on each other best, as often
        as that brings them nearer."""
        from scipy.spatial import cKDTree

        surface = shape_points(parts, LOOKED_AT)
        box = frame_of(surface)
        tree, points = cKDTree(surface), self.points[:COMPARED]
        distance, frame = min(((self._distance(surface, each), each) for each in (self.frame, box)), key=lambda x: x[0])
        for _ in range(ALIGNMENTS):
            _, back = tree.query(frame.placed(points))
            _, there = self.tree.query(frame.normalized(surface))
            pairs = np.vstack([points, self.points[there]]), np.vstack([surface[back], surface])
            moved = _similarity(*pairs)
            nearer = self._distance(surface, moved)
            if nearer >= distance:
                break
            distance, frame = nearer, moved
        return replace(self, frame=frame, box=box)

    def floor(self, parts: Sequence[Part], rng: np.random.Generator) -> float:
        """Of as many random points: the fewer a cloud has, the farther is every shape from it."""
        return cloud_target(sample_points(parts, len(self.points), rng), rng).compared(parts)[0]

    def _distance(self, surface: FloatArray, frame: Frame) -> float:
        from scipy.spatial import cKDTree

        normalized = frame.normalized(surface)
        there, _ = self.tree.query(normalized[:: LOOKED_AT // COMPARED])
        back, _ = cKDTree(normalized).query(self.points[:COMPARED])
        return float((there**2).mean() + (back**2).mean())


def cloud_target(points: FloatArray, rng: np.random.Generator) -> CloudTarget:
    """The target of a cloud (n, 3) that stands upright; of large ones, some points. It is not aligned yet."""
    from scipy.spatial import cKDTree

    chosen = rng.permutation(len(points))[: 2 * LOOKED_AT]
    normalized = frame_of(points).normalized(points)[chosen]
    nowhere = Frame(np.zeros(3), 1.0)
    return CloudTarget(normalized, cKDTree(normalized[:LOOKED_AT]), nowhere, nowhere)


@dataclass(frozen=True)
class DrawingTarget:
    """The lines of a drawing: `ink` bool (SIDE, SIDE), and `far` float64 (SIDE, SIDE), how far each pixel is from them,
    squared, in sides. Shapes are drawn as stage `sketches` does by `config`, from `view`.

    step: by how many degrees the camera is moved when the target is aligned again; zero before it is aligned at all.
    """

    program: Program
    config: SketchesConfig
    view: SketchView
    step: float
    ink: BoolArray
    far: FloatArray

    @property
    def camera(self) -> Camera:
        """That of the view, which does not wander."""
        return jittered_camera(self.view, np.random.default_rng(0))

    def compared(self, parts: Sequence[Part]) -> tuple[float, DrawingTarget]:
        lines = draw_fitted(self.program, tuple(parts), self.view, self.config, np.random.default_rng(0))
        return float(self.far[lines].mean() + _far(lines)[self.ink].mean()), self

    def floor(self, parts: Sequence[Part], rng: np.random.Generator) -> float:
        return 0.0

    def aligned(self, parts: Sequence[Part]) -> DrawingTarget:
        """Seen from where the shape's lines are nearest: at first from any view of the config and all around, and so
        once more when the shape is another than was guessed; then from beside where it was seen before, nearer each
        time."""
        step = self.step / 2.0 if self.step else FIRST_STEP
        if step < LEAST_STEP:
            return self
        moves = ((0.0, 0.0), (step, 0.0), (-step, 0.0), (0.0, step), (0.0, -step))
        views = [_moved(self.view, *move) for move in moves if self.step]
        if step >= FIRST_STEP / 2.0:
            views += [*map(_steady, self.config.views), *_around(self.program)]
        seen = [replace(self, view=view, step=step) for view in views]
        return min(seen, key=lambda each: each.compared(parts)[0])


def drawing_target(program: Program, config: SketchesConfig, ink: BoolArray) -> DrawingTarget:
    """The target of fitted ink (SIDE, SIDE). It is not aligned yet."""
    # a line is looked for, not every pixel of it
    quick = config.model_copy(update={"supersample": 1, "size": DRAWING_SIDE_PIXELS})
    return DrawingTarget(program, quick, _steady(config.views[0]), 0.0, ink, _far(ink))


def _around(program: Program) -> Iterator[SketchView]:
    """Views that people draw from: from the front and both sides, from a little to well above, or below what hangs."""
    for azimuth, elevation in product((-55.0, -35.0, -15.0, 0.0, 15.0, 35.0, 55.0), (12.0, 30.0, 50.0)):
        yield SketchView(azimuth=azimuth, elevation=elevation if program.view_elevation > 0 else -elevation)


def _moved(view: SketchView, azimuth: float, elevation: float) -> SketchView:
    found = min(max(view.elevation + elevation, -90.0), 90.0)
    return view.model_copy(update={"azimuth": view.azimuth + azimuth, "elevation": found})


def _far(ink: BoolArray) -> FloatArray:
    """How far each pixel of a square is from its ink, squared, in sides."""
    from scipy.ndimage import distance_transform_edt

    far: FloatArray = (distance_transform_edt(~ink) / DRAWING_SIDE_PIXELS) ** 2
    return far


def _steady(view: SketchView) -> SketchView:
    """A view that does not wander."""
    return view.model_copy(
        update=dict.fromkeys(("azimuth_jitter", "elevation_jitter", "fov_jitter", "distance_jitter"), 0.0)
    )


def _similarity(points: FloatArray, onto: FloatArray) -> Frame:
    """The frame whose `placed` brings points (n, 3) nearest to others (n, 3), by least squares."""
    centre, other = points.mean(axis=0), onto.mean(axis=0)
    spread = float(((points - centre) ** 2).sum())
    size = float(((points - centre) * (onto - other)).sum()) / spread if spread > 0.0 else 1.0
    size = size if size > 0.0 else 1.0
    return Frame(other - size * centre, size)
