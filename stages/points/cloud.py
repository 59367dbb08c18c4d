"""The point cloud of one assembly: its farthest points first, then its uniform ones."""

from __future__ import annotations

import numpy as np

from stages.points.surface import SurfacePoints, SurfaceTable, sample_assembly
from stages.shape.kit import Assembly

__all__ = ["sample_cloud"]


def sample_cloud(
    table: SurfaceTable, assembly: Assembly, uniform: int, farthest: int, pool: int, rng: np.random.Generator
) -> SurfacePoints:
    """`farthest` points picked out of `pool` uniform ones, in the order of picking, then `uniform` further points.

    `table` is the surface table of the kit's types. The two kinds have streams of their own: the uniform points are
    the same whatever `farthest` and `pool` are. At least one of the two counts is positive.
    """
    farthest_rng, uniform_rng = rng.spawn(2)
    if farthest == 0:
        return sample_assembly(table, assembly, uniform, uniform_rng)
    pooled = sample_assembly(table, assembly, pool, farthest_rng)
    picked = _spread(pooled, farthest, farthest_rng)
    return picked if uniform == 0 else picked.followed_by(sample_assembly(table, assembly, uniform, uniform_rng))


def _spread(pooled: SurfacePoints, n: int, rng: np.random.Generator) -> SurfacePoints:
    from stages.points.farthest import farthest_points

    return pooled.take(farthest_points(pooled.points, n, start=int(rng.integers(len(pooled.points)))))
