"""The selection of diverse variants: farthest-first traversal (greedy k-centre)."""

from __future__ import annotations

import numba
import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.kit import Kit
from stages.variations.novelty.features import AXES, FeatureExtractor
from stages.variations.requirements.identity import lost_label_counts
from stages.variations.settings import VariationsConfig

_SIZES = ("parts", "footprint", "height", "aspect")
_SKIPPED = "dominant"


def select_diverse(
    kit: Kit, counts: np.ndarray, features: np.ndarray, wanted: int, config: VariationsConfig, rng: np.random.Generator
) -> np.ndarray:
    """Return which of k variants are taken, int64 (min(wanted, k),), the most different first.

    Each is the farthest from the kit's exemplars and from all taken before. Beyond `selection.max_farthest_first` the
    rest are drawn at random. Variants without a part type of every exemplar come after all others, unless the config
    lets variants lose types.
    counts: int32 (k, types), parts by type
    features: float32 (k, 10)
    """
    exemplars = [exemplar.assembly for exemplar in kit.exemplars]
    extractor = FeatureExtractor(kit)
    pure = np.ones(1)
    known = [extractor.features(shape, pure, extractor.marks(shape), 1.0) for shape in exemplars]
    all_features = np.concatenate([features, known])
    all_counts = np.concatenate([counts, [np.bincount(shape.types, minlength=len(kit.types)) for shape in exemplars]])
    space = selection_space(all_counts, all_features)
    lost = np.zeros(len(counts), dtype=np.int64)
    if config.keeps_identity:
        lost = lost_label_counts(kit, counts)
    near = min(wanted, config.selection.max_farthest_first, len(counts))
    taken = np.empty(0, dtype=np.int64)
    for number in np.unique(lost):
        rows = np.flatnonzero(lost == number)
        starts = np.concatenate([space[len(counts) :], space[taken]])
        taken = np.concatenate([taken, rows[farthest_first(space[rows], starts, min(near - len(taken), len(rows)))]])
    left = rng.permutation(np.setdiff1d(np.arange(len(counts)), taken))
    left = left[np.argsort(lost[left], kind="stable")]
    return np.concatenate([taken, left[: max(wanted - near, 0)]])


def selection_space(counts: np.ndarray, features: np.ndarray) -> FloatArray:
    """Return points whose distances say how different variants are, float64 (k, types + axes).

    Shares of part types together weigh as much as all features; each feature has unit variance, sizes by their
    logarithm.
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
    """Return `wanted` of the points, int64, each the farthest from the starts and all taken before; of equals the
    first.

    points: float64 (n, d)
    starts: float64 (s, d)
    """
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
