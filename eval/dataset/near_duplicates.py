"""Near-twins: shapes of val and test whose clouds are as near to a cloud of train as two samplings of one shape are.

The distance of two clouds is the symmetric mean chamfer distance, laid upon each other as well as may be: centroid on
centroid, in the best of four quarter turns about the vertical, then moved a few times by the median step to the
nearest points. It is told in units of the shape's own resampling distance: that of two independent clouds of it.
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
"""By kit and split two independent clouds, float (n, 3), y up, of each shape."""

TWIN = 1.25
"""A near-twin is at most so many resampling distances from a shape of train."""
POINTS = 2048
"""Points of a cloud."""
COARSE = 256
"""Points of the clouds by which those shapes of train are chosen that are looked at closely."""
LOOKED_AT = 8
"""So many shapes of train, each in one turn, are looked at closely for each shape."""
STEPS = 3
"""So many times two clouds are moved upon each other."""

_TURNS = [np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]]) for c, s in ((1, 0), (0, 1), (-1, 0), (0, -1))]

COLUMNS = ("shapes of", "split", "shapes", "near-twins", "near-twins %", "least", "median")

NOTES = (
    "Distances to the nearest shape of train, in resampling distances of the shape: symmetric mean chamfer distance of "
    "clouds of equally many points, uniform by area, laid upon each other by their centroids, in the best of four "
    f"quarter turns about the vertical, and moved {STEPS} times by the median step to the nearest points; 1 is the "
    f"distance of two independent clouds of one shape. Near-twins: at most {TWIN:g}.",
)


@dataclass(frozen=True)
class Nearest:
    """The nearest shape of train: its place there and its distance, in resampling distances of the shape asked for."""

    place: int
    distance: float


def near_twins(nearest: Sequence[Nearest]) -> BoolArray:
    """Which shapes are near-twins of their nearest in train, bool (n,)."""
    return np.array([each.distance <= TWIN for each in nearest], dtype=np.bool_)


def dataset_clouds(folder: Path, seed: int) -> Clouds:
    """The clouds of a finished dataset, of POINTS points, in its coordinates; 0.1 MB a shape.

    Raises ConfigError where no dataset stands in `folder`.
    """
    clouds: dict[tuple[str, str], list[tuple[FloatArray, FloatArray]]] = {}
    for kit, split, key, shape in split_shapes(folder):
        first, second = decision_rng(seed, "near_twins", key).spawn(2)
        both = sample_shape(shape, POINTS, first).points, sample_shape(shape, POINTS, second).points
        clouds.setdefault((kit, split), []).append(both)
    return clouds


def nearest_by_split(clouds: Clouds) -> dict[tuple[str, str], list[Nearest]]:
    """By kit and split the nearest shape of train of each shape; for the splits but train of kits that have shapes
    there."""
    found = {}
    for (kit, split), asked in clouds.items():
        train = [first for first, _ in clouds.get((kit, "train"), ())]
        if split != "train" and train and asked:
            found[kit, split] = nearest_in_train(asked, train)
    return found


def near_twins_table(found: Mapping[tuple[str, str], Sequence[Nearest]]) -> Table:
    """One row for each kit and split."""
    rows = []
    for (kit, split), nearest in found.items():
        distances = [each.distance for each in nearest]
        twins = int(near_twins(nearest).sum())
        share = 100 * twins / len(nearest)
        rows.append((kit, split, len(nearest), twins, share, min(distances), median(distances)))
    return Table("Near-twins of train", COLUMNS, tuple(rows), NOTES)


def nearest_in_train(asked: Sequence[tuple[FloatArray, FloatArray]], train: Sequence[FloatArray]) -> list[Nearest]:
    """The nearest of `train`, clouds float (n, 3), for each shape of `asked`, two independent clouds of it.

    The LOOKED_AT that are nearest by the first COARSE points of each cloud are looked at closely.
    """
    centred = [_centred(cloud) for cloud in train]
    coarse = np.array([cloud[:COARSE] for cloud in centred])
    found = []
    for first, second in asked:
        unit = _mean_gap(_centred(first), np.asarray(second, np.float64) - np.mean(first, axis=0), steps=0)
        cloud = _centred(first)
        gaps = np.array([_coarse_distances(cloud[:COARSE] @ turn.T, coarse) for turn in _TURNS])
        turn_of, gap_of = gaps.argmin(axis=0), gaps.min(axis=0)
        best = Nearest(-1, np.inf)
        for other in np.argsort(gap_of, kind="stable")[:LOOKED_AT].tolist():
            distance = _mean_gap(cloud @ _TURNS[turn_of[other]].T, centred[other], STEPS) / unit
            best = min(best, Nearest(other, distance), key=lambda each: each.distance)
        found.append(best)
    return found


def cloud_distance(first: FloatArray, second: FloatArray) -> float:
    """The symmetric mean chamfer distance of two clouds float (n, 3), laid upon each other in the best quarter turn."""
    a, b = _centred(first), _centred(second)
    return min(_mean_gap(a @ turn.T, b, STEPS) for turn in _TURNS)


def _centred(cloud: FloatArray) -> FloatArray:
    points = np.asarray(cloud, dtype=np.float64)
    centred: FloatArray = points - points.mean(axis=0)
    return centred


def _mean_gap(first: FloatArray, second: FloatArray, steps: int) -> float:
    """The least symmetric mean chamfer distance while `first` is moved so many times by the median of the steps between
    nearest points: a median, so that where most of two shapes is the same, the rest does not push them apart."""
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
    """Symmetric mean chamfer distances of a cloud (n, 3) to each of `others` (k, n, 3), float64 (k,)."""
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
