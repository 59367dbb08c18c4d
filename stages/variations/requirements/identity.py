"""Identity: a variant keeps the part types that make its exemplars what they are, in about their shares.

A race track keeps its track, a room its door. Without this rule a search that wants variety ends in shapes that have
lost their subject.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stages.shape.arrays import BoolArray, FloatArray
from stages.shape.kit import Assembly, Kit
from stages.variations.requirements.named_labels import named_labels

DEFAULT_SHARE_FACTOR = 2.0


def common_labels(kit: Kit) -> tuple[str, ...]:
    """Return the labels, in the kit's order, that occur in every exemplar; hubs do not count."""
    smallest = _counts(kit, [exemplar.assembly for exemplar in kit.exemplars]).min(axis=0)
    return tuple(label for label, count in zip(kit.labels, smallest.tolist(), strict=True) if count)


def share_bounds(kit: Kit, labels: Sequence[str], factor: float = DEFAULT_SHARE_FACTOR) -> FloatArray:
    """Return the smallest and largest share of the parts that each label may have, float64 (labels, 2).

    labels: those that are bound, by their shares in the exemplars that have them; all others are free: 0 and infinity
    factor: by which the range of shares is widened to either side, at least 1

    A label whose smallest share is above 0 must occur, however small the share (see `out_of_bounds`). Raise ConfigError
    for a label that no part has.
    """
    is_bound = named_labels(kit, labels, "variations.require.keep_types")
    assemblies = [exemplar.assembly for exemplar in kit.exemplars]
    shares = _counts(kit, assemblies) / np.array([[max(len(assembly), 1)] for assembly in assemblies])
    is_bound &= (shares > 0).any(axis=0)  # a hub has no parts that are searched
    smallest = np.where(shares > 0, shares, np.inf).min(axis=0)
    low = np.where(is_bound, smallest / factor, 0.0)
    return np.stack([low, np.where(is_bound, shares.max(axis=0) * factor, np.inf)], axis=1)


def out_of_bounds(bounds: FloatArray, counts: np.ndarray) -> BoolArray:
    """Return which labels do not keep `share_bounds`, bool (k, labels); bounds are rounded outwards to whole parts.

    counts: parts of k shapes by label, int (k, labels)

    A label whose smallest share is above 0 has at least one part, and one part is never too many.
    """
    sizes = counts.sum(axis=1, keepdims=True)
    low, high = bounds[:, 0], bounds[:, 1]
    lacking = (low > 0) & (counts < np.maximum(np.floor(low * sizes + 1e-9), 1))
    with np.errstate(invalid="ignore"):
        too_many = (counts > 1) & (counts > np.ceil(high * sizes - 1e-9))
    wrong: BoolArray = lacking | too_many
    return wrong


def label_counts(kit: Kit, counts: np.ndarray) -> np.ndarray:
    """Return the parts of k shapes by label, int64 (k, labels). counts: by type, int (k, types)"""
    by_label = np.zeros((len(counts), len(kit.labels)), dtype=np.int64)
    for index, label in enumerate(kit.label_of.tolist()):
        by_label[:, label] += counts[:, index]
    return by_label


def lost_label_counts(kit: Kit, counts: np.ndarray) -> np.ndarray:
    """Return how many of the `common_labels` each of k shapes lacks, int64 (k,). counts: by type, int (k, types)"""
    common = set(common_labels(kit))
    missing: np.ndarray = (label_counts(kit, counts) == 0)[:, [label in common for label in kit.labels]].sum(axis=1)
    return missing


def _counts(kit: Kit, assemblies: Sequence[Assembly]) -> np.ndarray:
    """Return the parts of assemblies by label, int64 (k, labels)."""
    return np.array([np.bincount(kit.label_of[assembly.types], minlength=len(kit.labels)) for assembly in assemblies])
