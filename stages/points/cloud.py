"""The point cloud of one shape: its farthest points first, then its uniform ones."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numba
import numpy as np
import numpy.typing as npt

from stages.points.area_sampling import SurfacePoints, sample_parts, sample_shape
from stages.points.settings import SampledSurface
from stages.points.visibility import seen_from_outside
from stages.shape.geometry.bounds import shape_bounds
from stages.shape.geometry.pose import transform_points
from stages.shape.geometry.ray_casting import RayCaster
from stages.shape.shape import Shape

MAX_DRAW_ROUNDS = 1000
"""Maximum rounds of drawing the requested number of points until enough of them are visible."""

MAX_PART_DRAWS = 16
"""Draws for each point that a part lacks; only visible ones count."""

BOX_POINTS = 64

NormalizeMode = Literal["none", "unit_sphere", "unit_box"]


@dataclass(frozen=True)
class Normalization:
    """`(points - centre) * scale` moves points from the dataset's coordinates to the normalised ones."""

    centre: tuple[float, float, float]
    scale: float


def sample_cloud(
    shape: Shape,
    uniform: int,
    farthest: int,
    pool: int,
    surface: SampledSurface,
    rng: np.random.Generator,
    min_per_part: int = 0,
) -> SurfacePoints:
    """Return `farthest` points picked out of `pool` uniform ones, in the order of picking, then `uniform` further
    points.

    All are on the whole surface or on what is visible of it. The two kinds have separate streams: the uniform points do
    not depend on `farthest` and `pool`. At least one of the two counts is positive. Of the uniform points each part has
    at least `min_per_part`, of a visible surface as far as enough of it is seen. Raises ValueError if
    next to nothing is visible, and for more parts than points.
    """
    rays = RayCaster(shape) if surface == "visible" else None
    farthest_rng, uniform_rng = rng.spawn(2)
    drawn = None
    if uniform:
        drawn = _draw_points(shape, uniform, rays, uniform_rng)
        drawn = _fill_parts(shape, drawn, min_per_part, rays, rng.spawn(1)[0]) if min_per_part else drawn
        if farthest == 0:
            return drawn
    pooled = _draw_points(shape, pool, rays, farthest_rng)
    picked = _spread(pooled, farthest, farthest_rng)
    return picked if drawn is None else picked.followed_by(drawn)


def min_points_of_parts(shape: Shape, uniform: int, min_per_part: int) -> int:
    """Return how many of `uniform` points each part has at least: `min_per_part`, or an equal share of too few."""
    return min(min_per_part, uniform // len(shape))


def _fill_parts(
    shape: Shape, cloud: SurfacePoints, minimum: int, rays: RayCaster | None, rng: np.random.Generator
) -> SurfacePoints:
    """Return the cloud with some points of parts that have more than `minimum` moved to parts that have fewer.

    Which points are replaced is random, so that the order of the cloud stays random. Points that `rays` cannot see are
    not drawn.
    """
    if minimum * len(shape) > len(cloud.points):
        raise ValueError(f"{len(cloud.points):,} points are too few for {minimum} on each of {len(shape)} parts")
    counts = np.bincount(cloud.instances, minlength=len(shape))
    lacking = np.maximum(minimum - counts, 0)
    added = _points_of_parts(shape, lacking, rays, rng)
    spare = np.maximum(counts - minimum, 0)
    places: list[int] = []
    for place in rng.permutation(len(cloud.points)).tolist():
        if len(places) == len(added.points):
            break
        part = cloud.instances[place]
        if spare[part]:
            spare[part] -= 1
            places.append(place)
    return cloud.replaced(np.array(places, dtype=np.int64), added)


def _points_of_parts(
    shape: Shape, wanted: npt.NDArray[np.int64], rays: RayCaster | None, rng: np.random.Generator
) -> SurfacePoints:
    """Return `wanted` (n,) points of each part; fewer where MAX_PART_DRAWS draws for each find too few visible ones."""
    draws = wanted if rays is None else wanted * MAX_PART_DRAWS
    drawn = sample_parts(shape, np.repeat(np.arange(len(shape)), draws), rng)
    if rays is None:
        return drawn
    seen = drawn.take(np.flatnonzero(seen_from_outside(rays, drawn.points, drawn.normals)))
    # points are in the order of their parts: the rank of each within its part
    first = np.searchsorted(seen.instances, np.arange(len(shape)))
    return seen.take(np.flatnonzero(np.arange(len(seen.points)) - first[seen.instances] < wanted[seen.instances]))


def _draw_points(shape: Shape, n: int, rays: RayCaster | None, rng: np.random.Generator) -> SurfacePoints:
    """Return `n` points uniform by area, without those that `rays` cannot see."""
    if rays is None:
        return sample_shape(shape, n, rng)
    kept: SurfacePoints | None = None
    for _ in range(MAX_DRAW_ROUNDS):
        points = sample_shape(shape, n, rng)
        seen = points.take(np.flatnonzero(seen_from_outside(rays, points.points, points.normals)))
        kept = seen if kept is None else kept.followed_by(seen)
        if len(kept.points) >= n:
            return kept.take(np.arange(n))
    raise ValueError(f"of {MAX_DRAW_ROUNDS * n:,} points on the surface fewer than {n:,} are seen from outside")


def _spread(pooled: SurfacePoints, n: int, rng: np.random.Generator) -> SurfacePoints:
    return pooled.take(farthest_points(pooled.points, n, start=int(rng.integers(len(pooled.points)))))


def farthest_points(points: npt.NDArray[np.floating], n: int, start: int) -> npt.NDArray[np.int64]:
    """Return `n` indices int64 (n,), each of the point farthest from all picked before it, beginning with `start`.

    points: float (m, 3), n <= m

    Exact, as by brute force: a box of points is skipped if its nearest corner lies farther from the newest pick than
    every point of the box lies from its nearest pick. fpsample's fast variants ignore the start and refuse small
    inputs; its plain variant takes ten times as long.

    Of equally far points the one with the lowest index is picked; no index is picked twice. Raises ValueError if `n` or
    `start` is out of range.
    """
    if not 1 <= n <= len(points):
        raise ValueError(f"cannot pick {n} of {len(points)} points")
    if not 0 <= start < len(points):
        raise ValueError(f"start {start} is not the index of one of {len(points)} points")
    coordinates = np.ascontiguousarray(points, dtype=np.float64)
    order, first = _boxes(coordinates)
    picks: npt.NDArray[np.int64] = _pick(coordinates[order], order, first, n, start)
    return picks


def _boxes(points: npt.NDArray[np.float64]) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Return the points' indices sorted by the cells of a cubic grid, and where each occupied cell starts (and the
    end).

    A surface passes through about `3 r^2` of the `r^3` cells, so `r` is chosen to leave BOX_POINTS in each.
    """
    low = points.min(axis=0)
    side = float((points.max(axis=0) - low).max())
    resolution = min(max(round(math.sqrt(len(points) / (3 * BOX_POINTS))), 1), 40)
    along = (points - low) / side if side > 0.0 else np.zeros_like(points)
    cells = np.minimum(along * resolution, resolution - 1).astype(np.uint16)
    key = (cells[:, 0] * resolution + cells[:, 1]) * resolution + cells[:, 2]
    order = np.argsort(key, kind="stable")
    ranked = key[order]
    return order, np.concatenate([[0], np.flatnonzero(ranked[1:] != ranked[:-1]) + 1, [len(points)]])


@numba.njit(cache=True)
def _pick(points, order, first, n, start):
    """Return the picks in the points' original indices. `points` (m, 3) and `order` (m,) are in box order."""
    boxes = len(first) - 1
    low = np.empty((boxes, 3))
    high = np.empty((boxes, 3))
    for box in range(boxes):
        for axis in range(3):
            column = points[first[box] : first[box + 1], axis]
            low[box, axis] = column.min()
            high[box, axis] = column.max()
    squared = np.full(len(points), np.inf)
    far = np.full(boxes, np.inf)
    best = first[:-1].copy()
    picks = np.empty(n, dtype=np.int64)
    newest = 0
    while order[newest] != start:
        newest += 1
    for step in range(n):
        picks[step] = order[newest]
        x, y, z = points[newest, 0], points[newest, 1], points[newest, 2]
        squared[newest] = -1.0
        leader = 0
        for box in range(boxes):
            own = first[box] <= newest < first[box + 1]
            dx = max(low[box, 0] - x, x - high[box, 0], 0.0)
            dy = max(low[box, 1] - y, y - high[box, 1], 0.0)
            dz = max(low[box, 2] - z, z - high[box, 2], 0.0)
            if own or dx * dx + dy * dy + dz * dz < far[box]:
                farthest, where = -2.0, first[box]
                for i in range(first[box], first[box + 1]):
                    ex, ey, ez = points[i, 0] - x, points[i, 1] - y, points[i, 2] - z
                    distance = ex * ex + ey * ey + ez * ez
                    squared[i] = min(squared[i], distance)
                    if squared[i] > farthest or (squared[i] == farthest and order[i] < order[where]):
                        farthest, where = squared[i], i
                far[box], best[box] = farthest, where
            if far[box] > far[leader] or (far[box] == far[leader] and order[best[box]] < order[best[leader]]):
                leader = box
        newest = best[leader]
    return picks


def normalization(shape: Shape, mode: NormalizeMode) -> Normalization:
    """Return how to bring `shape` to a standard position and size.

    `unit_box`: centre of its box to the origin, longest side to 1. `unit_sphere`: the same centre to the origin,
    farthest vertex to distance 1. `none`: unchanged.
    """
    if mode == "none":
        return Normalization((0.0, 0.0, 0.0), 1.0)
    bounds = shape_bounds(shape)
    centre = bounds.mean(axis=0)
    if mode == "unit_box":
        size = float((bounds[1] - bounds[0]).max())
    else:
        size = max(
            float(np.linalg.norm(transform_points(pose, shape.meshes[index].vertices) - centre, axis=1).max())
            for index, pose in zip(shape.assembly.types, shape.assembly.poses, strict=True)
        )
    x, y, z = centre.tolist()
    return Normalization((x, y, z), 1.0 / size)
