"""Scans of which a piece is missing: they lie on the shape, and beyond their edge the shape may go on (geocode §4.4).

A scan is taken to be what lies on one side of a plane. The planes asked about are the faces of the hull around it, for
a cut leaves a large one: what a shape has beyond one of them costs nothing, what it has on this side has to be there in
the scan. So a box that is fitted to the rest is no explanation, and neither is a shape whose leg the scan should show.
A box says no longer how large the shape is and where it stands; these are searched for, too.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from stages.programs.curves.part import Part
from stages.shape.arrays import FloatArray
from stages.training.recovery.clouds import Frame, frame_of
from stages.training.recovery.surface import sample_points, shape_points

COMPARED, LOOKED_AT = 1024, 2048
"""Points of each side that look for the nearest of the other, and among which it is looked for."""
PLANES = 64
"""The largest faces of the hull, beyond which something may be missing."""
EDGE = 0.005
"""What lies so little beyond a face, in sides of the scan's box, lies on it."""
PRICE = 1e-4
"""What it costs that the whole shape is missing: no plane is asked for where that explains nothing."""
SHARES = (1.0, 0.85, 0.7, 0.6, 0.5)
"""Sizes of the scan's box, in longest sides of the shape's, that are tried beside those by which a side fits."""
SMALLEST, LARGEST = 0.4, 1.08
GLIMPSE = 128
"""Points of the scan by which places are told apart at first; the best CLOSER are looked at closely, and from the best
FINAL the scan is moved to where it lies best."""
CLOSER, FINAL = 16, 2
MOVES = 6
NEAR = 0.9
"""The share of its points that a scan is moved by: those that are nearest to the shape."""


@dataclass(frozen=True)
class PartialTarget:
    """A torn scan that stands somewhere beside a program's shapes: `points` float64 (n, 3) in the box from -0.5 to 0.5,
    in random order, and `tree`, a search tree of them; `planes` float64 (k, 4), normals and offsets of its hull's
    largest faces; `frame` puts them into the program's coordinates, where the shape that it was placed for has the box
    `box`, float64 (2, 3); None before it is placed at all."""

    points: FloatArray
    tree: Any
    planes: FloatArray
    frame: Frame
    box: FloatArray | None

    def compared(self, parts: Sequence[Part]) -> tuple[float, PartialTarget]:
        """Where it stands; and, if the shape's box is another than before, moved with its lower or its upper corner,
        and as large as before beside it."""
        surface = _Surface.of(parts)
        return self._best(surface, [self.frame, *self._moved_with(surface.box)])

    def aligned(self, parts: Sequence[Part]) -> PartialTarget:
        """From where it stands, and from any of the shape's sides with any size, moved to where it lies best."""
        surface = _Surface.of(parts)
        starts = [*([self.frame] if self.box is not None else []), *self._places(surface)]
        return self._best(surface, [self._settled(surface, each) for each in starts])[1]

    def floor(self, parts: Sequence[Part], rng: np.random.Generator) -> float:
        """Of as many random points on what the scan shows of the shape."""
        from scipy.spatial import cKDTree

        missing = self.missing(parts)
        drawn = self.frame.normalized(sample_points(parts, round(len(self.points) / (1.0 - min(missing, 0.9))), rng))
        if missing > 0.0:
            plane = self.planes[self._judged(_Surface.of(parts), self.frame)[1]]
            drawn = drawn[drawn @ plane[:3] + plane[3] <= EDGE]
        if not len(drawn):
            return 0.0
        own = replace(self, points=drawn, tree=cKDTree(drawn[:LOOKED_AT]))
        return own._distance(_Surface.of(parts), self.frame)

    def missing(self, parts: Sequence[Part]) -> float:
        """The share of a shape's surface that lies where the scan has nothing to say; 0 where it explains nothing."""
        return self._judged(_Surface.of(parts), self.frame)[2]

    def _distance(self, surface: _Surface, frame: Frame) -> float:
        return self._judged(surface, frame)[0]

    def _judged(self, surface: _Surface, frame: Frame) -> tuple[float, int, float]:
        """How far a shape is from the scan at a place: the mean squared distance from the scan to it, and from what the
        scan should show of it; the face beyond which the scan shows nothing, and the share of the shape there."""
        back, _ = surface.tree.query(frame.placed(self.points[:COMPARED]))
        seen_from = frame.normalized(surface.points[:: LOOKED_AT // COMPARED])
        there = self.tree.query(seen_from)[0] ** 2
        shown = seen_from @ self.planes[:, :3].T + self.planes[:, 3] <= EDGE
        share = 1.0 - shown.mean(axis=0)
        costs = (there @ shown) / np.maximum(shown.sum(axis=0), 1) + PRICE * share
        face = int(np.argmin(costs))
        cost, missing = (float(costs[face]), float(share[face]))
        if there.mean() <= cost:
            cost, missing = float(there.mean()), 0.0
        return float((back**2).mean()) / frame.size**2 + cost, face, missing

    def _best(self, surface: _Surface, frames: Sequence[Frame]) -> tuple[float, PartialTarget]:
        distance, frame = min(((self._distance(surface, each), each) for each in frames), key=lambda each: each[0])
        return distance, replace(self, frame=frame, box=surface.box)

    def _moved_with(self, box: FloatArray) -> Iterator[Frame]:
        if self.box is None:
            return
        moved = box - self.box
        if np.abs(moved).max() <= 1e-4 * self.frame.size:
            return
        for corner in moved:
            yield Frame(self.frame.centre + corner, self.frame.size)
        grown = float(np.ptp(box, axis=0).max() / np.ptp(self.box, axis=0).max())
        for before, after in zip(self.box, box, strict=True):
            yield Frame(after + (self.frame.centre - before) * grown, self.frame.size * grown)

    def _places(self, surface: _Surface) -> list[Frame]:
        """Where the scan may stand: as large as one of the shape's sides says, or by SHARES; along each axis at the
        lower end, the upper end, or in the middle. Those where it lies nearest to the shape."""
        low, high = self.points.min(axis=0), self.points.max(axis=0)
        sides, own = np.ptp(surface.box, axis=0), high - low
        longest = float(sides.max())
        sizes = {float(sides[axis] / own[axis]) for axis in range(3) if own[axis] > 0.05}
        found = []
        for size in sorted(sizes | {longest * share for share in SHARES}):
            if not SMALLEST * longest <= size <= LARGEST * longest:
                continue
            ends = surface.box - np.array([low, high]) * size
            for centre in product(*np.vstack([ends, ends.mean(axis=0)]).T):
                frame = Frame(np.array(centre), size)
                near, _ = surface.tree.query(frame.placed(self.points[:GLIMPSE]))
                found.append((float((near**2).mean()) / size**2, frame))
        closer = [frame for _, frame in sorted(found, key=lambda each: each[0])[:CLOSER]]
        return sorted(closer, key=lambda each: self._distance(surface, each))[:FINAL]

    def _settled(self, surface: _Surface, frame: Frame) -> Frame:
        """Moved, and made larger or smaller, so that pairs of nearest points lie on each other, while that is nearer.

        Least squares make a scan smaller than it is: the size is also tried that keeps how far its points are spread.
        """
        distance = self._distance(surface, frame)
        for _ in range(MOVES):
            points = self.points[:COMPARED]
            reach, back = surface.tree.query(frame.placed(points))
            near = reach <= np.quantile(reach, NEAR)
            points, onto = points[near], surface.points[back[near]]
            centre, other = points.mean(axis=0), onto.mean(axis=0)
            spread = float(((points - centre) ** 2).sum())
            sizes = [frame.size, float(np.sqrt(((onto - other) ** 2).sum() / spread))] if spread > 0.0 else [frame.size]
            moved = [Frame(other - size * centre, size) for size in sizes if size > 0.0]
            nearer, best = min(((self._distance(surface, each), each) for each in moved), key=lambda each: each[0])
            if nearer >= distance:
                break
            distance, frame = nearer, best
        return frame


def partial_target(points: FloatArray, rng: np.random.Generator) -> PartialTarget:
    """The target of a torn scan (n, 3) that stands upright. It is not placed yet."""
    from scipy.spatial import ConvexHull, cKDTree

    chosen = rng.permutation(len(points))[: 2 * LOOKED_AT]
    normalized = frame_of(points).normalized(points)[chosen]
    # joggled, for a scan may be flat
    hull = ConvexHull(normalized, qhull_options="QJ Pp")
    corners = normalized[hull.simplices]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    planes = hull.equations[np.argsort(-areas, kind="stable")[:PLANES]]
    return PartialTarget(normalized, cKDTree(normalized[:LOOKED_AT]), planes, Frame(np.zeros(3), 1.0), None)


@dataclass(frozen=True)
class _Surface:
    """points: float64 (LOOKED_AT, 3) on a shape; tree: a search tree of them; box: float64 (2, 3) around them."""

    points: FloatArray
    tree: Any
    box: FloatArray

    @classmethod
    def of(cls, parts: Sequence[Part]) -> _Surface:
        from scipy.spatial import cKDTree

        points = shape_points(parts, LOOKED_AT)
        return cls(points, cKDTree(points), np.array([points.min(axis=0), points.max(axis=0)]))
