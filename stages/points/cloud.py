"""The point cloud of one shape: its farthest points first, then its uniform ones."""

from __future__ import annotations

import numpy as np

from stages.points.area_sampling import SurfacePoints, sample_shape
from stages.points.settings import SampledSurface
from stages.points.visibility import seen_from_outside
from stages.shape.geometry.ray_casting import RayCaster
from stages.shape.shape import Shape

MAX_DRAW_ROUNDS = 1000
"""So many times as many points as asked are drawn at most, until enough of them are seen."""


def sample_cloud(
    shape: Shape, uniform: int, farthest: int, pool: int, surface: SampledSurface, rng: np.random.Generator
) -> SurfacePoints:
    """`farthest` points picked out of `pool` uniform ones, in the order of picking, then `uniform` further points;
    all of them on the whole surface or on what is visible of it.

    The two kinds have streams of their own: the uniform points are the same whatever `farthest` and `pool` are. At
    least one of the two counts is positive. Raises ValueError for a shape of which next to nothing is visible.
    """
    casting = RayCaster(shape) if surface == "visible" else None
    farthest_rng, uniform_rng = rng.spawn(2)
    if farthest == 0:
        return _drawn(shape, uniform, casting, uniform_rng)
    pooled = _drawn(shape, pool, casting, farthest_rng)
    picked = _spread(pooled, farthest, farthest_rng)
    return picked if uniform == 0 else picked.followed_by(_drawn(shape, uniform, casting, uniform_rng))


def _drawn(shape: Shape, n: int, casting: RayCaster | None, rng: np.random.Generator) -> SurfacePoints:
    """`n` points uniform by area, those that `casting` does not see left out."""
    if casting is None:
        return sample_shape(shape, n, rng)
    kept: SurfacePoints | None = None
    for _ in range(MAX_DRAW_ROUNDS):
        drawn = sample_shape(shape, n, rng)
        seen = drawn.take(np.flatnonzero(seen_from_outside(casting, drawn.points, drawn.normals)))
        kept = seen if kept is None else kept.followed_by(seen)
        if len(kept.points) >= n:
            return kept.take(np.arange(n))
    raise ValueError(f"of {MAX_DRAW_ROUNDS * n:,} points on the surface fewer than {n:,} are seen from outside")


def _spread(pooled: SurfacePoints, n: int, rng: np.random.Generator) -> SurfacePoints:
    from stages.points.farthest import farthest_points

    return pooled.take(farthest_points(pooled.points, n, start=int(rng.integers(len(pooled.points)))))
