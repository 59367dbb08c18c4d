"""Near copies among samples of different producers: shapes whose clouds are as near as two clouds of one shape."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import combinations

import numpy as np
import numpy.typing as npt

from stages.points.area_sampling import sample_shape
from stages.shape.arrays import FloatArray
from stages.shape.geometry.bounds import shape_bounds
from stages.shape.shape import Shape

POINTS_PER_CLOUD = 512
MAX_EXTENT_DIFFERENCE = 0.05
"""Largest difference of a side of the boxes around two near copies, as a share of the diagonal."""
MAX_MOMENT_DIFFERENCE = 0.03
"""Largest difference of a mean or a standard deviation of their clouds, as a share of the diagonal."""
MAX_DISTANCE_RATIO = 1.25
"""Largest distance of two near copies, as a multiple of the distance of two clouds of one shape."""
QUARTER_TURNS = tuple(
    np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]]) for c, s in ((1, 0), (0, 1), (-1, 0), (0, -1))
)


def unit_clouds(shape: Shape, rng: np.random.Generator) -> npt.NDArray[np.float32]:
    """Return two independent clouds of a shape, its box around 0 with diagonal 1, float32 (2, n, 3)."""
    low, high = shape_bounds(shape)
    clouds = [sample_shape(shape, POINTS_PER_CLOUD, part).points for part in rng.spawn(2)]
    scaled = (np.stack(clouds) - (low + high) / 2) / max(float(np.linalg.norm(high - low)), 1e-12)
    result: npt.NDArray[np.float32] = scaled.astype(np.float32)
    return result


def copy_features(clouds: npt.NDArray[np.float32], extents: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return features (k, 8), which differ by at most 1 between near copies, and the distance of each pair of clouds.

    clouds: two of each shape, float32 (k, 2, n, 3), as `unit_clouds`
    extents: sides of the box around each shape, as shares of its diagonal, float64 (k, 3)
    """
    points = np.concatenate([clouds[:, 0], clouds[:, 1]], axis=1)
    moments = np.column_stack(
        [
            _turned(points.std(axis=1)),
            points[..., 1].mean(axis=1),
            np.linalg.norm(points[..., [0, 2]], axis=2).mean(axis=1),
        ]
    )
    features = np.column_stack([_turned(extents) / MAX_EXTENT_DIFFERENCE, moments / MAX_MOMENT_DIFFERENCE])
    return features, np.array([_distance(first, second) for first, second in clouds], dtype=np.float64)


def near_copy_pairs(
    features: FloatArray,
    spacings: FloatArray,
    cloud_of: Callable[[int], npt.NDArray[np.float32]],
    groups: npt.NDArray[np.int64],
    makers: npt.NDArray[np.int64],
    splits: npt.NDArray[np.int64],
) -> Iterator[tuple[int, int]]:
    """Yield pairs of near copies of different groups, producers and splits, the lower index first.

    features, spacings: of each shape, as `copy_features`
    cloud_of: returns a cloud of a shape, float32 (n, 3)
    groups, makers, splits: int64 (k,); makers are producers
    """
    for first, second in sorted(_candidates(features, groups, makers, splits)):
        limit = MAX_DISTANCE_RATIO * min(spacings[first], spacings[second])
        one, other = cloud_of(first), cloud_of(second)
        if any(_distance(one @ turn.T, other) <= limit for turn in QUARTER_TURNS):
            yield first, second


def _candidates(
    features: FloatArray,
    groups: npt.NDArray[np.int64],
    makers: npt.NDArray[np.int64],
    splits: npt.NDArray[np.int64],
) -> Iterator[tuple[int, int]]:
    """Yield pairs of different groups, producers and splits with similar features, the lower index first."""
    from scipy.spatial import cKDTree

    members = [np.flatnonzero(makers == maker) for maker in np.unique(makers)]
    trees = [cKDTree(features[own]) for own in members]
    for a, b in combinations(range(len(trees)), 2):
        for place, near in enumerate(trees[a].query_ball_tree(trees[b], 1.0, p=np.inf)):
            first = int(members[a][place])
            for second in members[b][near].tolist():
                if splits[first] != splits[second] and groups[first] != groups[second]:
                    yield min(first, second), max(first, second)


def _turned(lengths: FloatArray) -> FloatArray:
    """Return lengths along x, y and z (k, 3) in an order that quarter turns about y do not change."""
    return np.column_stack([np.sort(lengths[:, [0, 2]], axis=1), lengths[:, 1]])


def _distance(first: npt.NDArray[np.float32], second: npt.NDArray[np.float32]) -> float:
    """Return the symmetric mean Chamfer distance of two clouds (n, 3)."""
    squares = (first**2).sum(axis=1)[:, None] + (second**2).sum(axis=1)[None] - 2.0 * first @ second.T
    gaps = np.sqrt(np.maximum(squares, 0.0))
    return float(gaps.min(axis=0).mean() + gaps.min(axis=1).mean()) / 2
