"""Does a dropped shape keep its height? (shapeassembly App. E, without time steps)

The paper drops every connected component of a shape on the ground as one rigid body, pushes it a little, and calls the
shape unstable if a component's resting height has changed. Between pushes a slow body only tips over edges of its
convex hull. It rests where the vertical through its centre of mass meets the face it lies on. From there a push takes
it over an edge if it tilts it far enough. So the answer is a walk over rests: the least tilt after which the centre of
mass has another height. Nothing slides, and nothing bounces.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from heapq import heappop, heappush

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.geometry.polygons import convex_hull, inside_margin

FALL_SHARE = 0.025
"""Relative change of the height of the centre of mass of a fallen component, as in the authors' programs; their text
has 0.1.
"""
FALL_PUSH = 0.1
"""Push of a dropped shape, in weights, the tangent of a tilt; the value whose shares of real shape programs are nearest
to published ones.
"""
SAME_PLACE_SHARE = 1e-4
"""Points this near, as a share of the diagonal of the shape, lie on the ground together."""
MAX_RESTS = 40
"""A body that has rested on this many faces without falling rolls."""


@dataclass(frozen=True)
class Fall:
    """Whether a shape that is dropped and pushed comes to rest at another height, and what of it.

    tilt_degrees: least tilt of the ground after which a piece does; 0: by itself; infinite: never
    part: first part of the piece, or the first part that nothing connects to the ground; -1: none
    """

    tilt_degrees: float
    part: int

    @property
    def falls(self) -> bool:
        """Whether a push of FALL_PUSH is enough."""
        return self.tilt_degrees <= math.degrees(math.atan(FALL_PUSH))


@dataclass(frozen=True)
class Body:
    """A rigid body above the ground at height 0.

    points: float64 (q, 3)
    centre: centre of mass, float64 (3,)
    """

    points: FloatArray
    centre: FloatArray

    @property
    def height(self) -> float:
        return float(self.centre[2])

    def lowered(self) -> Body:
        """Return the body lowered until it touches the ground."""
        drop = np.array([0.0, 0.0, self.points[:, 2].min()])
        return Body(self.points - drop, self.centre - drop)

    def support(self, near: float) -> FloatArray:
        """Return the corners, float64 (k, 2), of the outline of the points at most `near` above the ground."""
        low = self.points[self.points[:, 2] <= near, :2]
        outline: FloatArray = low[convex_hull(low)]
        return outline

    def tipped(self, pivot: FloatArray, way: FloatArray, near: float) -> Body:
        """Return the body turned in direction `way` (2,) about the level axis through `pivot` (2,) on the ground.

        It turns until the next of its points touches the ground.
        """
        arms = self.points - [*pivot, 0.0]
        along, up = arms[:, :2] @ way, arms[:, 2]
        angle = np.arctan2(up, along)[up > near].min(initial=np.pi)
        cosine, sine = np.cos(angle) - 1.0, np.sin(angle)
        # Along the way and up turn into each other, what is across stays.
        turn = np.eye(3)
        turn[:2, :2] += cosine * np.outer(way, way)
        turn[:2, 2], turn[2, :2], turn[2, 2] = sine * way, -sine * way, 1.0 + cosine
        return Body(arms @ turn.T, turn @ (self.centre - [*pivot, 0.0])).lowered()


def come_to_rest(body: Body, diagonal: float) -> Body:
    """Return the body at rest after it was dropped.

    It tips over points and edges, its centre sinking, until the vertical through the centre meets the face below it.
    """
    near = SAME_PLACE_SHARE * diagonal
    body = body.lowered()
    for _ in range(len(body.points)):
        support = body.support(near)
        if len(support) > 2 and inside_margin(support, body.centre[:2]) >= -near:
            return body
        pivot, way = _downhill(support, body.centre[:2], near)
        body = body.tipped(pivot, way, near)
    return body


def hull_vertices(points: FloatArray) -> FloatArray:
    """Return the points, (q, 3), that are corners of their convex hull; all of them if they have no volume."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        corners: FloatArray = points[ConvexHull(points).vertices]
    except QhullError:
        return points
    return corners


def tilt_to_fall(body: Body, diagonal: float) -> float:
    """Return the least tilt, in degrees, after which the body rests with its centre FALL_SHARE higher or lower.

    It is 0 if the body falls by itself, and infinite if it never does: a ball, a cube.
    """
    start = body.lowered().height
    near = SAME_PLACE_SHARE * diagonal
    ahead: list[tuple[float, int, Body]] = [(0.0, 0, come_to_rest(body, diagonal))]
    rests: list[Body] = []
    tried = 0
    while ahead and len(rests) < MAX_RESTS:
        tilt, _, rest = heappop(ahead)
        if abs(rest.height - start) > FALL_SHARE * start:
            return tilt
        if any(np.abs(rest.points[:, 2] - other.points[:, 2]).max() <= 10 * near for other in rests):
            continue
        rests.append(rest)
        support = rest.support(near)
        for corner, following in zip(support, np.roll(support, -1, axis=0), strict=True):
            edge = following - corner
            outward = np.array([edge[1], -edge[0]]) / np.linalg.norm(edge)
            distance = max(0.0, float((corner - rest.centre[:2]) @ outward))
            needed = float(np.degrees(np.arctan2(distance, rest.height)))
            tried += 1
            over = come_to_rest(rest.tipped(corner, outward, near), diagonal)
            heappush(ahead, (max(tilt, needed), tried, over))
    return float("inf")


def _downhill(support: FloatArray, centre: FloatArray, near: float) -> tuple[FloatArray, FloatArray]:
    """Return the point of the support's outline nearest to the centre, and the unit direction (2,) from it to the
    centre.

    If the centre is above an edge, the direction is perpendicular to the edge.
    """
    edges = np.roll(support, -1, axis=0) - support
    lengths = np.maximum((edges**2).sum(axis=1), np.finfo(float).tiny)
    along = np.clip(((centre - support) * edges).sum(axis=1) / lengths, 0.0, 1.0)
    nearest_points = support + along[:, None] * edges
    nearest = int(np.linalg.norm(nearest_points - centre, axis=1).argmin())
    way = centre - nearest_points[nearest]
    if np.linalg.norm(way) <= near:
        way = np.array([edges[nearest, 1], -edges[nearest, 0]]) if len(support) > 1 else np.array([1.0, 0.0])
    return nearest_points[nearest], way / np.linalg.norm(way)
