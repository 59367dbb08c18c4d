"""A partial scan as the target of a search: the shape may go on beyond the edge of the scan (geocode §4.4).

The scan is taken for what lies on one side of a plane. The candidate planes are the largest faces of its convex hull,
since a cut leaves a large face. The part of a shape beyond the plane costs nothing; the part on this side must be in
the scan. So neither a box fitted to the rest explains the scan, nor a shape with a leg that the scan should show.

The scan's box tells neither the size nor the position of the shape; the search covers these too.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from stages.programs.curves.part import Part
from stages.recovery.cloud_target import QUERY_POINTS, SEARCHED_POINTS
from stages.shape.arrays import FloatArray
from stages.shape.geometry.triangles import triangle_areas
from stages.training.recovery.clouds import Frame, frame_of
from stages.training.recovery.surface import sample_points, shape_points

MAX_CUT_PLANES = 64
CUT_TOLERANCE = 0.005
"""Points this far beyond a plane count as on it, in sides of the scan's box."""
MISSING_SHARE_PENALTY = 1e-4
"""Cost where the whole shape is missing: no plane is used that explains nothing."""
SCAN_SIZES = (1.0, 0.85, 0.7, 0.6, 0.5)
"""Sizes of the scan's box to try, in longest sides of the shape's, besides those at which a side fits."""
MIN_SCAN_SIZE, MAX_SCAN_SIZE = 0.4, 1.08
COARSE_POINTS = 128
"""Points of the scan in the first comparison of positions."""
FINE_POSITIONS = 16
"""Positions compared with all points."""
ALIGNED_POSITIONS = 2
"""Positions from which the scan is aligned."""
MAX_ALIGNMENT_STEPS = 6
ALIGNED_POINTS_SHARE = 0.9
"""The nearest points are aligned, the others ignored."""


@dataclass(frozen=True)
class PartialTarget:
    """A partial scan, placed in a program's coordinates.

    points: float64 (n, 3) in the box from -0.5 to 0.5, in random order
    tree: a search tree of the first of them
    planes: float64 (k, 4), normals and offsets of the largest faces of the convex hull
    frame: puts the points into the program's coordinates
    box: float64 (2, 3), the box of the shape that the scan was placed for; None before
    """

    points: FloatArray
    tree: Any
    planes: FloatArray
    frame: Frame
    box: FloatArray | None

    def compared(self, parts: Sequence[Part]) -> tuple[float, PartialTarget]:
        """Compare where the scan is; also moved with a corner of the shape's box, where that has changed."""
        surface = _Surface.of(parts)
        return self._best(surface, [self.frame, *self._moved_with(surface.box)])

    def aligned(self, parts: Sequence[Part]) -> PartialTarget:
        """Align from the present position, and from any side of the shape with any size."""
        surface = _Surface.of(parts)
        starts = [*([self.frame] if self.box is not None else []), *self._positions(surface)]
        return self._best(surface, [self._aligned_frame(surface, start) for start in starts])[1]

    def floor(self, parts: Sequence[Part], rng: np.random.Generator) -> float:
        """The distance of as many random points on the visible part of the shape."""
        from scipy.spatial import cKDTree

        missing = self.missing(parts)
        count = round(len(self.points) / (1.0 - min(missing, 0.9)))
        points = self.frame.normalized(sample_points(parts, count, rng))
        if missing > 0.0:
            plane = self.planes[self._compare(_Surface.of(parts), self.frame)[1]]
            points = points[points @ plane[:3] + plane[3] <= CUT_TOLERANCE]
        if not len(points):
            return 0.0
        sampled = replace(self, points=points, tree=cKDTree(points[:SEARCHED_POINTS]))
        return sampled._distance(_Surface.of(parts), self.frame)

    def missing(self, parts: Sequence[Part]) -> float:
        """The share of a shape's surface beyond the cut; 0 where a cut explains nothing."""
        return self._compare(_Surface.of(parts), self.frame)[2]

    def _distance(self, surface: _Surface, frame: Frame) -> float:
        return self._compare(surface, frame)[0]

    def _compare(self, surface: _Surface, frame: Frame) -> tuple[float, int, float]:
        """Distance of a shape from the scan at a position, index of the best plane, and missing share of the shape.

        The distance is the mean squared distance from the scan to the shape, plus that from the shape's part on this
        side of the plane to the scan.
        """
        to_surface, _ = surface.tree.query(frame.placed(self.points[:QUERY_POINTS]))
        points = frame.normalized(surface.points[:: SEARCHED_POINTS // QUERY_POINTS])
        to_scan = self.tree.query(points)[0] ** 2
        visible = points @ self.planes[:, :3].T + self.planes[:, 3] <= CUT_TOLERANCE
        missing = 1.0 - visible.mean(axis=0)
        costs = (to_scan @ visible) / np.maximum(visible.sum(axis=0), 1) + MISSING_SHARE_PENALTY * missing
        plane = int(np.argmin(costs))
        cost, share = float(costs[plane]), float(missing[plane])
        if to_scan.mean() <= cost:
            cost, share = float(to_scan.mean()), 0.0
        return float((to_surface**2).mean()) / frame.size**2 + cost, plane, share

    def _best(self, surface: _Surface, frames: Sequence[Frame]) -> tuple[float, PartialTarget]:
        distances = [self._distance(surface, frame) for frame in frames]
        best = int(np.argmin(distances))
        return distances[best], replace(self, frame=frames[best], box=surface.box)

    def _moved_with(self, box: FloatArray) -> Iterator[Frame]:
        """Frames that follow the lower or the upper corner of a changed box, with the old size and scaled."""
        if self.box is None:
            return
        shifts = box - self.box
        if np.abs(shifts).max() <= 1e-4 * self.frame.size:
            return
        for shift in shifts:
            yield Frame(self.frame.centre + shift, self.frame.size)
        growth = float(np.ptp(box, axis=0).max() / np.ptp(self.box, axis=0).max())
        for before, after in zip(self.box, box, strict=True):
            yield Frame(after + (self.frame.centre - before) * growth, self.frame.size * growth)

    def _positions(self, surface: _Surface) -> list[Frame]:
        """The most promising positions of the scan.

        Sizes: one that fits each of the shape's sides, and SCAN_SIZES. Along each axis: lower end, upper end, middle.
        """
        low, high = self.points.min(axis=0), self.points.max(axis=0)
        sides, scan_sides = np.ptp(surface.box, axis=0), high - low
        longest = float(sides.max())
        sizes = {float(sides[axis] / scan_sides[axis]) for axis in range(3) if scan_sides[axis] > 0.05}
        candidates = []
        for size in sorted(sizes | {longest * share for share in SCAN_SIZES}):
            if not MIN_SCAN_SIZE * longest <= size <= MAX_SCAN_SIZE * longest:
                continue
            ends = surface.box - np.array([low, high]) * size
            for centre in product(*np.vstack([ends, ends.mean(axis=0)]).T):
                frame = Frame(np.array(centre), size)
                to_surface, _ = surface.tree.query(frame.placed(self.points[:COARSE_POINTS]))
                candidates.append((float((to_surface**2).mean()) / size**2, frame))
        fine = [frame for _, frame in sorted(candidates, key=lambda candidate: candidate[0])[:FINE_POSITIONS]]
        return sorted(fine, key=lambda frame: self._distance(surface, frame))[:ALIGNED_POSITIONS]

    def _aligned_frame(self, surface: _Surface, frame: Frame) -> Frame:
        """Align by pairs of nearest points while the distance falls.

        Least squares shrink a scan, so the size that keeps the spread of its points is tried as well.
        """
        distance = self._distance(surface, frame)
        for _ in range(MAX_ALIGNMENT_STEPS):
            points = self.points[:QUERY_POINTS]
            reach, nearest = surface.tree.query(frame.placed(points))
            near = reach <= np.quantile(reach, ALIGNED_POINTS_SHARE)
            points, onto = points[near], surface.points[nearest[near]]
            centre, onto_centre = points.mean(axis=0), onto.mean(axis=0)
            spread = float(((points - centre) ** 2).sum())
            sizes = [frame.size]
            if spread > 0.0:
                sizes.append(float(np.sqrt(((onto - onto_centre) ** 2).sum() / spread)))
            moved = [Frame(onto_centre - size * centre, size) for size in sizes if size > 0.0]
            distances = [self._distance(surface, candidate) for candidate in moved]
            best = int(np.argmin(distances))
            if distances[best] >= distance:
                break
            distance, frame = distances[best], moved[best]
        return frame


def partial_target(points: FloatArray, rng: np.random.Generator) -> PartialTarget:
    """Make the target of an upright partial scan (n, 3). It is not placed yet."""
    from scipy.spatial import ConvexHull, cKDTree

    chosen = rng.permutation(len(points))[: 2 * SEARCHED_POINTS]
    normalized = frame_of(points).normalized(points)[chosen]
    # joggled, since a scan may be flat
    hull = ConvexHull(normalized, qhull_options="QJ Pp")
    corners = normalized[hull.simplices]
    areas = triangle_areas(corners)
    planes = hull.equations[np.argsort(-areas, kind="stable")[:MAX_CUT_PLANES]]
    return PartialTarget(normalized, cKDTree(normalized[:SEARCHED_POINTS]), planes, Frame(np.zeros(3), 1.0), None)


@dataclass(frozen=True)
class _Surface:
    """Even points on a shape.

    points: float64 (n, 3)
    tree: a search tree of them
    box: float64 (2, 3), around them
    """

    points: FloatArray
    tree: Any
    box: FloatArray

    @classmethod
    def of(cls, parts: Sequence[Part]) -> _Surface:
        from scipy.spatial import cKDTree

        points = shape_points(parts, SEARCHED_POINTS)
        return cls(points, cKDTree(points), np.array([points.min(axis=0), points.max(axis=0)]))
