"""A whole cloud as the target of a search."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stages.programs.curves.part import Part
from stages.shape.arrays import FloatArray
from stages.training.recovery.clouds import Frame, frame_of
from stages.training.recovery.surface import sample_points, shape_points

QUERY_POINTS = 1024
"""Points of each side whose nearest neighbours are looked up."""
SEARCHED_POINTS = 2048
"""Points of each side among which they are looked up."""
MAX_ALIGNMENT_STEPS = 4


@dataclass(frozen=True)
class CloudTarget:
    """A whole cloud, placed in a program's coordinates.

    points: float64 (n, 3) in the box from -0.5 to 0.5, in random order
    tree: a search tree of the first of them
    frame: puts the points into the program's coordinates
    box: the box around the shape that the target was placed for
    """

    points: FloatArray
    tree: Any
    frame: Frame
    box: Frame

    def compared(self, parts: Sequence[Part]) -> tuple[float, CloudTarget]:
        """Compare where the target is; also box on box, where the shape's box has changed.

        A cloud does not say how large a shape is. A parameter that makes it higher might as well make all others
        smaller.
        """
        surface = shape_points(parts, SEARCHED_POINTS)
        box = frame_of(surface)
        frames = [self.frame] if box.is_like(self.box) else [self.frame, box]
        distance, frame = self._nearest_frame(surface, frames)
        return distance, replace(self, frame=frame, box=box)

    def aligned(self, parts: Sequence[Part]) -> CloudTarget:
        """Align box on box, then by least squares over pairs of nearest points, while the distance falls."""
        from scipy.spatial import cKDTree

        surface = shape_points(parts, SEARCHED_POINTS)
        box = frame_of(surface)
        tree, points = cKDTree(surface), self.points[:QUERY_POINTS]
        distance, frame = self._nearest_frame(surface, [self.frame, box])
        for _ in range(MAX_ALIGNMENT_STEPS):
            _, to_surface = tree.query(frame.placed(points))
            _, to_cloud = self.tree.query(frame.normalized(surface))
            moved = _similarity(np.vstack([points, self.points[to_cloud]]), np.vstack([surface[to_surface], surface]))
            moved_distance = self._distance(surface, moved)
            if moved_distance >= distance:
                break
            distance, frame = moved_distance, moved
        return replace(self, frame=frame, box=box)

    def floor(self, parts: Sequence[Part], rng: np.random.Generator) -> float:
        """The distance of as many random points: the fewer a cloud has, the farther is every shape from it."""
        return cloud_target(sample_points(parts, len(self.points), rng), rng).compared(parts)[0]

    def _nearest_frame(self, surface: FloatArray, frames: Sequence[Frame]) -> tuple[float, Frame]:
        distances = [self._distance(surface, frame) for frame in frames]
        best = int(np.argmin(distances))
        return distances[best], frames[best]

    def _distance(self, surface: FloatArray, frame: Frame) -> float:
        from scipy.spatial import cKDTree

        normalized = frame.normalized(surface)
        to_cloud, _ = self.tree.query(normalized[:: SEARCHED_POINTS // QUERY_POINTS])
        to_surface, _ = cKDTree(normalized, compact_nodes=False, balanced_tree=False).query(self.points[:QUERY_POINTS])
        return float((to_cloud**2).mean() + (to_surface**2).mean())


def cloud_target(points: FloatArray, rng: np.random.Generator) -> CloudTarget:
    """Make the target of an upright cloud (n, 3), subsampled where it is large. It is not aligned yet."""
    from scipy.spatial import cKDTree

    chosen = rng.permutation(len(points))[: 2 * SEARCHED_POINTS]
    normalized = frame_of(points).normalized(points)[chosen]
    unplaced = Frame(np.zeros(3), 1.0)
    return CloudTarget(normalized, cKDTree(normalized[:SEARCHED_POINTS]), unplaced, unplaced)


def _similarity(points: FloatArray, onto: FloatArray) -> Frame:
    """The frame whose `placed` brings points (n, 3) nearest to others (n, 3), by least squares."""
    centre, other_centre = points.mean(axis=0), onto.mean(axis=0)
    variance = float(((points - centre) ** 2).sum())
    size = float(((points - centre) * (onto - other_centre)).sum()) / variance if variance > 0.0 else 1.0
    size = size if size > 0.0 else 1.0
    return Frame(other_centre - size * centre, size)
