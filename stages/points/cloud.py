"""The point cloud of one shape: its farthest points first, then its uniform ones."""

from __future__ import annotations

import numpy as np

from stages.points.area_sampling import SurfacePoints, sample_shape
from stages.shape.shape import Shape

__all__ = ["sample_cloud"]


def sample_cloud(shape: Shape, uniform: int, farthest: int, pool: int, rng: np.random.Generator) -> SurfacePoints:
    """`farthest` points picked out of `pool` uniform ones, in the order of picking, then `uniform` further points.

    The two kinds have streams of their own: the uniform points are the same whatever `farthest` and `pool` are. At
    least one of the two counts is positive.
    """
    farthest_rng, uniform_rng = rng.spawn(2)
    if farthest == 0:
        return sample_shape(shape, uniform, uniform_rng)
    pooled = sample_shape(shape, pool, farthest_rng)
    picked = _spread(pooled, farthest, farthest_rng)
    return picked if uniform == 0 else picked.followed_by(sample_shape(shape, uniform, uniform_rng))


def _spread(pooled: SurfacePoints, n: int, rng: np.random.Generator) -> SurfacePoints:
    from stages.points.farthest import farthest_points

    return pooled.take(farthest_points(pooled.points, n, start=int(rng.integers(len(pooled.points)))))
