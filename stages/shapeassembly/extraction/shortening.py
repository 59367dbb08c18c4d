"""Part shortening: a leaf whose end is sunk into another leaf is cut back to its visible part."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shapeassembly.extraction.boxes import UNIT_CORNERS, corners_of_box, inside
from stages.shapeassembly.extraction.hierarchy import Box, PartNode

_MIN_KEPT_SHARE = 0.05
"""A part is never cut to less of its length: a part hidden in another stays."""


def shorten_parts(root: PartNode) -> PartNode:
    """Cut back every leaf where that does not change what is visible (shapeassembly App. C).

    A leaf face within another leaf moves inwards while the removed part is inside that leaf. Smaller leaves come first,
    so that the result does not depend on the order of the file.
    """
    leaves = list(root.leaves())
    boxes = [leaf.box for leaf in leaves]
    order = sorted(
        range(len(boxes)), key=lambda i: (round(float(np.prod(boxes[i].size)), 9), *boxes[i].center.tolist())
    )
    centers = np.stack([box.center for box in boxes])
    reach = np.array([np.linalg.norm(box.size) / 2 for box in boxes])
    for i in order:
        near = np.linalg.norm(centers - centers[i], axis=1) <= reach + reach[i]
        for j in order:
            if near[j] and i != j:
                boxes[i] = _cut(boxes[i], boxes[j])
    return _with_boxes(root, iter(boxes))


def _with_boxes(part: PartNode, boxes: Iterator[Box]) -> PartNode:
    """Return the tree with the leaves' boxes taken in order."""
    if not part.children:
        return replace(part, box=next(boxes))
    return replace(part, children=tuple(_with_boxes(child, boxes) for child in part.children))


def _cut(box: Box, other: Box) -> Box:
    """Return a box without its ends inside another."""
    corners = corners_of_box(box)
    within = inside(other, corners, 1e-9)
    if within.sum() < 4:
        return box
    for axis in range(3):
        for side in (0.0, 1.0):
            face = UNIT_CORNERS[:, axis] == side
            if not within[face].all() or box.size[axis] <= 0:
                continue
            inward = box.axes[axis] * (1.0 if side == 0.0 else -1.0)
            depth = min(_exit(other, corner, inward) for corner in corners[face])
            if 1e-6 * box.size[axis] < depth < box.size[axis] * (1 - _MIN_KEPT_SHARE):
                size = box.size.copy()
                size[axis] -= depth
                return _cut(Box(box.center + inward * depth / 2, size, box.axes), other)
    return box


def _exit(box: Box, start: FloatArray, direction: FloatArray) -> float:
    """Return how far a ray from `start` in a box runs until it leaves it."""
    local, slope = box.axes @ (start - box.center), box.axes @ direction
    with np.errstate(divide="ignore", invalid="ignore"):
        lengths = (np.sign(slope) * box.size / 2 - local) / slope
    return float(np.min(lengths[np.abs(slope) > 1e-12], initial=np.inf))
