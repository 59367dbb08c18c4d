"""The point cloud of one shape: its farthest points first, then its uniform ones."""

from __future__ import annotations

import numpy as np

from stages.points.area_sampling import SurfacePoints, sample_shape
from stages.points.settings import SampledSurface
from stages.points.visibility import seen_from_outside
from stages.shape.geometry.ray_casting import RayCaster
from stages.shape.shape import Shape

MAX_DRAW_ROUNDS = 1000
"""Maximum rounds of drawing the requested number of points until enough of them are visible."""


def sample_cloud(
    shape: Shape, uniform: int, farthest: int, pool: int, surface: SampledSurface, rng: np.random.Generator
) -> SurfacePoints:
    """Return `farthest` points picked out of `pool` uniform ones, in the order of picking, then `uniform` further
    points.

    All are on the whole surface or on what is visible of it. The two kinds have separate streams: the uniform points do
    not depend on `farthest` and `pool`. At least one of the two counts is positive. Raises ValueError for a shape of
    which next to nothing is visible.
    """
    rays = RayCaster(shape) if surface == "visible" else None
    farthest_rng, uniform_rng = rng.spawn(2)
    if farthest == 0:
        return _draw_points(shape, uniform, rays, uniform_rng)
    pooled = _draw_points(shape, pool, rays, farthest_rng)
    picked = _spread(pooled, farthest, farthest_rng)
    return picked if uniform == 0 else picked.followed_by(_draw_points(shape, uniform, rays, uniform_rng))


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
    from stages.points.farthest import farthest_points

    return pooled.take(farthest_points(pooled.points, n, start=int(rng.integers(len(pooled.points)))))
