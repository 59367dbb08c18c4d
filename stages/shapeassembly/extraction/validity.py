"""Checks of an extracted program's geometry against its input: F-score and rootedness (shapeassembly §5.3)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shapeassembly.execution.interpreter import Execution
from stages.shapeassembly.extraction.boxes import bounding_box, box_corners, box_gap, surface_distance
from stages.shapeassembly.extraction.hierarchy import Box

MAX_CONNECTED_GAP_SHARE = 0.02
"""Parts further apart than this share of the shape's diagonal are not connected (shapeassembly App. E)."""

_GOLDEN = np.array([0.7548776662466927, 0.5698402909980532])
"""Steps of the additive recurrence that fills a square most evenly."""


def execution_boxes(execution: Execution) -> list[Box]:
    """The boxes of the leaves of an executed program."""
    frames = execution.frames.transpose(0, 2, 1)
    return [Box(*each) for each in zip(execution.centres, execution.sizes, frames, strict=True)]


def surface_points(boxes: Sequence[Box], count: int) -> FloatArray:
    """About `count` points spread evenly over the surfaces of the boxes, float64 (n, 3); always the same ones."""
    areas = np.array([[box.size[(axis + 1) % 3] * box.size[(axis + 2) % 3] for axis in range(3)] for box in boxes])
    shares = np.ceil(areas / max(float(areas.sum()) * 2, 1e-12) * count).astype(int)
    found = []
    for box, counts in zip(boxes, shares.tolist(), strict=True):
        for axis, number in enumerate(counts):
            spread = (np.arange(1, number + 1)[:, None] * _GOLDEN) % 1.0 - 0.5
            place = np.insert(spread, axis, 0.5, axis=1)
            for side in (-1.0, 1.0):
                place[:, axis] = side / 2
                found.append(box.center + (place * box.size) @ box.axes)
    return np.concatenate(found)


def f_score(made: Sequence[Box], wanted: Sequence[Box], distance: float, count: int = 4096) -> float:
    """F-score from 0 to 100 of two sets of boxes: the harmonic mean of the shares of each one's surface that lie
    within `distance` of the other's surface (Knapitsch et al. 2017). Points on one are measured against the exact
    surface of the other."""
    precision = float((surface_distance(surface_points(made, count), list(wanted)) <= distance).mean())
    recall = float((surface_distance(surface_points(wanted, count), list(made)) <= distance).mean())
    return 200 * precision * recall / (precision + recall) if precision + recall else 0.0


def is_rooted(boxes: Sequence[Box]) -> bool:
    """Whether a way through touching boxes leads from the ground to every one of them."""
    corners = np.stack([box_corners(box) for box in boxes])
    whole = bounding_box(corners.reshape(-1, 3), np.eye(3))
    limit = MAX_CONNECTED_GAP_SHARE * float(np.linalg.norm(whole.size))
    low, high = corners.min(axis=1), corners.max(axis=1)
    reached = set(np.flatnonzero(low[:, 1] <= low[:, 1].min() + limit).tolist())
    frontier = sorted(reached)
    while frontier:
        i = frontier.pop()
        near = (low <= high[i] + limit).all(axis=1) & (high >= low[i] - limit).all(axis=1)
        for j in np.flatnonzero(near).tolist():
            if j not in reached and box_gap(boxes[i], boxes[j])[0] <= limit:
                reached.add(j)
                frontier.append(j)
    return len(reached) == len(boxes)
