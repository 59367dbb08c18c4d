"""Find parts that lose a close neighbour above or below which no contact holds.

A column that ends a hair below a roof has no contact with it. A search may therefore raise the walls and leave the
columns behind. Every contact is then known, but the shape looks like a ruin.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from stages.shape.arrays import BoolArray, FloatArray
from stages.shape.geometry.contact import world_boxes
from stages.shape.kit import Assembly, Kit

MAX_GAP_SHARE = 0.1
"""Largest gap between a part and what covers it, as a share of the part's height."""
MIN_OVERLAP_SHARE = 0.1
"""Overlap along both level axes above which one part covers another, as a share of the narrower one's width."""
MIN_COVERED_BEFORE, MAX_COVERED_AFTER = 0.6, 0.25
"""A label lost support if at least the first share of its parts is covered in the exemplars, and less than the second
share in half of the shapes."""
MIN_PARTS_SHARE = 0.05
"""Share of the exemplars' parts that must have lost support before shapes count as broken."""


def lost_support(kit: Kit, shapes: Sequence[Assembly]) -> tuple[str, ...]:
    """Return the labels whose parts are covered from above or below in the exemplars, but hardly ever in `shapes`.

    Hub labels are left out. The result is empty if such labels make up less than MIN_PARTS_SHARE of all parts.
    """
    if not shapes:
        return ()
    wholes = [exemplar.whole for exemplar in kit.exemplars]
    counts = np.sum([np.bincount(kit.label_of[whole.types], minlength=len(kit.labels)) for whole in wholes], axis=0)
    is_candidate = counts > 0
    is_candidate[kit.label_of[list(kit.grammar.hubs)]] = False
    lost = np.zeros(len(kit.labels), dtype=bool)
    before = [np.array(list(_covered_shares(kit, whole))) for whole in wholes]
    after = np.array([list(_covered_shares(kit, shape)) for shape in shapes])
    for end in range(2):
        least = np.min([np.where(np.isnan(shares[end]), 1.0, shares[end]) for shares in before], axis=0)
        for label in np.flatnonzero(is_candidate & (least >= MIN_COVERED_BEFORE)).tolist():
            shares = after[:, end, label]
            shares = shares[~np.isnan(shares)]
            lost[label] |= len(shares) > 0 and float(np.median(shares)) < MAX_COVERED_AFTER
    if counts[lost].sum() < MIN_PARTS_SHARE * counts.sum():
        return ()
    return tuple(kit.labels[label] for label in np.flatnonzero(lost).tolist())


def _covered_shares(kit: Kit, assembly: Assembly) -> Iterator[FloatArray]:
    """Yield the share of covered parts by label, float64 (labels,), from above and then from below; NaN for labels
    without parts."""
    boxes = world_boxes(kit.types, assembly.types, assembly.poses)
    labels = kit.label_of[assembly.types]
    counts = np.bincount(labels, minlength=len(kit.labels)).astype(np.float64)
    counts[counts == 0] = np.nan
    for covered in _covered(boxes, {"y": 1, "z": 2}[kit.up], kit.contact_tolerance):
        yield np.bincount(labels, weights=covered, minlength=len(kit.labels)) / counts


def _covered(boxes: FloatArray, up: int, tolerance: float) -> BoolArray:
    """Return which boxes (n, 2, 3) have another close above, and which close below, bool (2, n)."""
    low, high = boxes[:, 0], boxes[:, 1]
    overlaps = ~np.eye(len(boxes), dtype=bool)
    for axis in {0, 1, 2} - {up}:
        ends = np.minimum(high[:, None, axis], high[None, :, axis])
        shared = ends - np.maximum(low[:, None, axis], low[None, :, axis])
        width = high[:, axis] - low[:, axis]
        overlaps &= shared > MIN_OVERLAP_SHARE * np.minimum(width[:, None], width[None])
    max_gap = np.maximum(MAX_GAP_SHARE * (high[:, up] - low[:, up]), tolerance)[:, None]
    gaps = np.abs(low[None, :, up] - high[:, None, up])
    covered: BoolArray = np.any([overlaps & (gaps <= max_gap), overlaps & (max_gap >= gaps.T)], axis=2)
    return covered
