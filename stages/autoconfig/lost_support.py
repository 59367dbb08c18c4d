"""Do shapes keep what stands above and below their parts, where no contact holds it?

Columns that end a hair below a roof have no contact with it, and a search may raise the walls and leave the columns
behind: each contact that counts is one that was seen, and what one sees is a ruin.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from stages.shape.arrays import BoolArray, FloatArray
from stages.shape.geometry.contact import world_boxes
from stages.shape.kit import Assembly, Kit

GAP = 0.1
"""A part is covered by what is farther from its end by no more than this share of its height."""
BESIDE = 0.1
"""And shares more than this part of the narrower one's width with it, along both level axes."""
MOSTLY, LEFT = 0.6, 0.25
"""Parts of a label are bared where at least MOSTLY of them are covered in the exemplars, and fewer than LEFT in half of
the shapes."""
MANY = 0.05
"""Shapes are broken where labels of so many of the exemplars' parts are bared."""


def lost_support(kit: Kit, shapes: Sequence[Assembly]) -> tuple[str, ...]:
    """The labels whose parts have something close above them, or close below, in the exemplars of a kit, and nearly
    never in `shapes`; none where these are few of the exemplars' parts. Hubs, if they are left out, are not asked."""
    if not shapes:
        return ()
    wholes = [each.whole for each in kit.exemplars]
    counts = np.sum([np.bincount(kit.label_of[each.types], minlength=len(kit.labels)) for each in wholes], axis=0)
    asked = counts > 0
    asked[kit.label_of[list(kit.grammar.hubs)]] = False
    found = np.zeros(len(kit.labels), dtype=bool)
    before = [np.array(list(_shares(kit, each))) for each in wholes]
    after = np.array([list(_shares(kit, each)) for each in shapes])
    for end in range(2):
        least = np.min([np.where(np.isnan(each[end]), 1.0, each[end]) for each in before], axis=0)
        for label in np.flatnonzero(asked & (least >= MOSTLY)).tolist():
            shares = after[:, end, label]
            shares = shares[~np.isnan(shares)]
            found[label] |= len(shares) > 0 and float(np.median(shares)) < LEFT
    if counts[found].sum() < MANY * counts.sum():
        return ()
    return tuple(kit.labels[label] for label in np.flatnonzero(found).tolist())


def _shares(kit: Kit, assembly: Assembly) -> Iterator[FloatArray]:
    """The share of the parts of each label that are covered from above, then from below, float64 (labels,); not a
    number for labels that are not there."""
    boxes = world_boxes(kit.types, assembly.types, assembly.poses)
    labels = kit.label_of[assembly.types]
    there = np.bincount(labels, minlength=len(kit.labels)).astype(np.float64)
    there[there == 0] = np.nan
    for covered in _covered(boxes, {"y": 1, "z": 2}[kit.up], kit.contact_tolerance):
        yield np.bincount(labels, weights=covered, minlength=len(kit.labels)) / there


def _covered(boxes: FloatArray, up: int, tolerance: float) -> BoolArray:
    """Which of some boxes (n, 2, 3) have another close above them, and which close below, bool (2, n)."""
    low, high = boxes[:, 0], boxes[:, 1]
    beside = ~np.eye(len(boxes), dtype=bool)
    for axis in {0, 1, 2} - {up}:
        shared = np.minimum(high[:, None, axis], high[None, :, axis]) - np.maximum(
            low[:, None, axis], low[None, :, axis]
        )
        width = high[:, axis] - low[:, axis]
        beside &= shared > BESIDE * np.minimum(width[:, None], width[None])
    near = np.maximum(GAP * (high[:, up] - low[:, up]), tolerance)[:, None]
    gaps = np.abs(low[None, :, up] - high[:, None, up])
    found: BoolArray = np.any([beside & (gaps <= near), beside & (near >= gaps.T)], axis=2)
    return found
