"""Near-duplicates: validation and test shapes as close to a training shape as two samplings of one shape are.

Two clouds are aligned by their centroids, in the best of four quarter turns about the vertical, then moved a few times
by the median step to the nearest points. Their distance is the symmetric mean Chamfer distance. Its unit is the
resampling distance of the shape: that of two independent clouds of it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median

import numba
import numpy as np

from eval.engine.shapes import split_shapes
from eval.engine.table import Table
from pipeline.randomness import decision_rng
from stages.points.area_sampling import sample_shape
from stages.shape.arrays import BoolArray, FloatArray

Clouds = Mapping[tuple[str, str], Sequence[tuple[FloatArray, FloatArray]]]
"""By kit and split: two independent clouds, float (n, 3), y up, of each shape."""

MAX_DUPLICATE_DISTANCE = 1.25
"""In resampling distances."""
POINTS_PER_CLOUD = 2048
COARSE_POINTS = 256
"""Points of a cloud by which candidates are chosen."""
CANDIDATES_PER_SHAPE = 8
ALIGNMENT_STEPS = 3

_TURNS = [np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]]) for c, s in ((1, 0), (0, 1), (-1, 0), (0, -1))]

COLUMNS = ("shapes of", "split", "shapes", "duplicates", "duplicates %", "least", "median")

NOTES = (
    "Distances to the nearest training shape: symmetric mean Chamfer distance of clouds sampled uniformly by area. "
    "Clouds are aligned by their centroids, in the best of four quarter turns about the vertical, and moved "
    f"{ALIGNMENT_STEPS} times by the median step to the nearest points. Unit: the distance of two independent clouds "
    f"of one shape. Duplicates: at most {MAX_DUPLICATE_DISTANCE:g}.",
)


@dataclass(frozen=True)
class NearestShape:
    """The training shape nearest to a shape."""

    index: int
    """Among the training shapes of the kit."""
    distance: float
    """In resampling distances of the shape."""


def near_duplicates(nearest: Sequence[NearestShape]) -> BoolArray:
    """Return which shapes are near-duplicates, bool (n,)."""
    return np.array([shape.distance <= MAX_DUPLICATE_DISTANCE for shape in nearest], dtype=np.bool_)


def dataset_clouds(folder: Path, seed: int) -> Clouds:
    """Sample the clouds of a finished dataset, POINTS_PER_CLOUD points each; 0.1 MB a shape.

    Raises ConfigError if there is no dataset in `folder`.
    """
    clouds: dict[tuple[str, str], list[tuple[FloatArray, FloatArray]]] = {}
    for kit, split, key, shape in split_shapes(folder):
        pair = tuple(
            sample_shape(shape, POINTS_PER_CLOUD, rng).points for rng in decision_rng(seed, "near_twins", key).spawn(2)
        )
        clouds.setdefault((kit, split), []).append((pair[0], pair[1]))
    return clouds


def nearest_by_split(clouds: Clouds) -> dict[tuple[str, str], list[NearestShape]]:
    """Return the nearest training shape of each validation and test shape, by kit and split."""
    nearest = {}
    for (kit, split), pairs in clouds.items():
        train = [first for first, _ in clouds.get((kit, "train"), ())]
        if split != "train" and train and pairs:
            nearest[kit, split] = nearest_in_train(pairs, train)
    return nearest


def near_duplicates_table(nearest: Mapping[tuple[str, str], Sequence[NearestShape]]) -> Table:
    """Return one row for each kit and split."""
    rows = []
    for (kit, split), shapes in nearest.items():
        distances = [shape.distance for shape in shapes]
        duplicates = int(near_duplicates(shapes).sum())
        share = 100 * duplicates / len(shapes)
        rows.append((kit, split, len(shapes), duplicates, share, min(distances), median(distances)))
    return Table("Near-duplicates of training shapes", COLUMNS, tuple(rows), NOTES)


def nearest_in_train(pairs: Sequence[tuple[FloatArray, FloatArray]], train: Sequence[FloatArray]) -> list[NearestShape]:
    """Return the nearest training shape for each shape.

    Only the CANDIDATES_PER_SHAPE nearest by the first COARSE_POINTS points are compared by all points.

    pairs: two independent clouds of each shape, float (n, 3); train: a cloud of each training shape, float (n, 3).
    """
    centred = [_centred(cloud) for cloud in train]
    coarse = np.array([cloud[:COARSE_POINTS] for cloud in centred])
    nearest = []
    for first, second in pairs:
        unit = aligned_distance(_centred(first), np.asarray(second, np.float64) - np.mean(first, axis=0), steps=0)
        cloud = _centred(first)
        gaps = np.array([_coarse_distances(cloud[:COARSE_POINTS] @ turn.T, coarse) for turn in _TURNS])
        turn_of, gap_of = gaps.argmin(axis=0), gaps.min(axis=0)
        best = NearestShape(-1, np.inf)
        for other in np.argsort(gap_of, kind="stable")[:CANDIDATES_PER_SHAPE].tolist():
            turned = cloud @ _TURNS[turn_of[other]].T
            candidate = NearestShape(other, aligned_distance(turned, centred[other], ALIGNMENT_STEPS) / unit)
            best = min(best, candidate, key=lambda shape: shape.distance)
        nearest.append(best)
    return nearest


def _centred(cloud: FloatArray) -> FloatArray:
    points = np.asarray(cloud, dtype=np.float64)
    centred: FloatArray = points - points.mean(axis=0)
    return centred


def aligned_distance(first: FloatArray, second: FloatArray, steps: int) -> float:
    """Return the least symmetric mean Chamfer distance while `first` moves by the median step between nearest points.

    The median aligns what most of two shapes shares, whatever the rest is.
    """
    from scipy.spatial import cKDTree

    of_first, of_second = cKDTree(first), cKDTree(second)
    least, shift = np.inf, np.zeros(3)
    for step in range(steps + 1):
        there, to = of_second.query(first + shift)
        back, of = of_first.query(second - shift)
        least = min(least, float(there.mean() + back.mean()) / 2)
        if step < steps:
            gaps = np.concatenate([second[to] - first, second - first[of]])
            shift = np.median(gaps, axis=0)
    return least


@numba.njit(cache=True)
def _coarse_distances(cloud, others):
    """Return symmetric mean Chamfer distances of a cloud (n, 3) to each of `others` (k, n, 3), float64 (k,)."""
    k, n = others.shape[:2]
    distances = np.empty(k)
    back = np.empty(n)
    for other in range(k):
        back[:] = np.inf
        total = 0.0
        for i in range(n):
            least = np.inf
            for j in range(n):
                x = cloud[i, 0] - others[other, j, 0]
                y = cloud[i, 1] - others[other, j, 1]
                z = cloud[i, 2] - others[other, j, 2]
                gap = x * x + y * y + z * z
                if gap < least:
                    least = gap
                if gap < back[j]:
                    back[j] = gap
            total += least**0.5
        for j in range(n):
            total += back[j] ** 0.5
        distances[other] = total / (2 * n)
    return distances
