"""The selection: which of the found variants make the dataset, so that few cover what many hold."""

from __future__ import annotations

import numba
import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.kit import Kit
from stages.variations.novelty.features import AXES, FeatureExtractor
from stages.variations.settings import SelectionConfig

_SIZES = ("parts", "footprint", "height", "aspect")
_SKIPPED = "dominant"


def select_diverse(
    kit: Kit, counts: np.ndarray, features: np.ndarray, wanted: int, config: SelectionConfig, rng: np.random.Generator
) -> np.ndarray:
    """Which of k variants are taken, int64 (min(wanted, k),), the most telling first.

    Each is the one farthest from the kit's exemplars and from all taken before (greedy k-centre). When more than
    `config.max_farthest_first` are wanted the rest are drawn at random.
    counts: int32 (k, types); features: float32 (k, 10).
    """
    exemplars = [each.assembly for each in kit.exemplars]
    test = FeatureExtractor(kit)
    pure = np.ones(1)
    known = [test.features(each, pure, test.marks(each), 1.0) for each in exemplars]
    all_features = np.concatenate([features, known])
    all_counts = np.concatenate([counts, [np.bincount(each.types, minlength=len(kit.types)) for each in exemplars]])
    space = selection_space(all_counts, all_features)
    near = min(wanted, config.max_farthest_first, len(counts))
    taken = farthest_first(space[: len(counts)], space[len(counts) :], near)
    left = np.setdiff1d(np.arange(len(counts)), taken)
    return np.concatenate([taken, rng.permutation(left)[: max(wanted - near, 0)]])


def selection_space(counts: np.ndarray, features: np.ndarray) -> FloatArray:
    """Points whose distances say how different variants are, float64 (k, types + axes).

    Shares of part types, which together weigh as much as all axes of the archive; each axis varies alike, sizes by
    their logarithm.
    """
    shares = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
    axes = [axis for axis in AXES if axis != _SKIPPED]
    columns = features[:, [AXES.index(axis) for axis in axes]].astype(np.float64)
    for number, axis in enumerate(axes):
        if axis in _SIZES:
            columns[:, number] = np.log2(np.maximum(columns[:, number], 1e-9))
        elif axis == "cycle_rank":
            columns[:, number] = np.log2(columns[:, number] + 1)
    spreads = columns.std(axis=0)
    columns /= np.where(spreads > 1e-9, spreads, np.inf)
    together = np.sqrt(shares.var(axis=0).sum())
    shares = shares * (np.sqrt(len(axes)) / together) if together > 1e-9 else np.zeros_like(shares)
    return np.concatenate([shares, columns], axis=1)


@numba.njit(cache=True)
def farthest_first(points, starts, wanted):
    """Greedy k-centre: `wanted` of the points, int64, each the farthest from the starts and all taken before; the
    first of equals. points: float64 (n, d); starts: float64 (s, d)."""
    n, d = points.shape
    gaps = np.full(n, np.inf)
    taken = np.empty(wanted, dtype=np.int64)
    for round_number in range(len(starts) + wanted):
        if round_number < len(starts):
            centre = starts[round_number]
        else:
            best = 0
            for i in range(1, n):
                if gaps[i] > gaps[best]:
                    best = i
            taken[round_number - len(starts)] = best
            gaps[best] = -1.0
            centre = points[best]
        for i in range(n):
            if gaps[i] > 0.0:
                gap = 0.0
                for j in range(d):
                    x = points[i, j] - centre[j]
                    gap += x * x
                    if gap >= gaps[i]:
                        break
                if gap < gaps[i]:
                    gaps[i] = gap
    return taken
