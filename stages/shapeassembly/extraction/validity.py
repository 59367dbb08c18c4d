"""Checks of an extracted program's geometry against its input: F-score and rootedness (shapeassembly §5.3)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shapeassembly.execution.interpreter import Execution
from stages.shapeassembly.extraction.boxes import bounding_box, box_gap, corners_of_box, surface_distance
from stages.shapeassembly.extraction.hierarchy import Box

MAX_CONNECTED_GAP_SHARE = 0.02
"""Maximum gap of connected parts, as a share of the shape's diagonal (shapeassembly App. E)."""

_GOLDEN = np.array([0.7548776662466927, 0.5698402909980532])
"""Steps of the additive recurrence that fills a square most evenly."""


def execution_boxes(execution: Execution) -> list[Box]:
    """Return the boxes of the leaves of an executed program."""
    frames = execution.frames.transpose(0, 2, 1)
    return [Box(*box) for box in zip(execution.centres, execution.sizes, frames, strict=True)]


def even_surface_points(boxes: Sequence[Box], count: int) -> FloatArray:
    """Return about `count` points evenly on the surfaces of the boxes, float64 (n, 3), always the same."""
    areas = np.array([[box.size[(axis + 1) % 3] * box.size[(axis + 2) % 3] for axis in range(3)] for box in boxes])
    shares = np.ceil(areas / max(float(areas.sum()) * 2, 1e-12) * count).astype(int)
    points = []
    for box, counts in zip(boxes, shares.tolist(), strict=True):
        for axis, number in enumerate(counts):
            offsets = (np.arange(1, number + 1)[:, None] * _GOLDEN) % 1.0 - 0.5
            local = np.insert(offsets, axis, 0.5, axis=1)
            for side in (-1.0, 1.0):
                local[:, axis] = side / 2
                points.append(box.center + (local * box.size) @ box.axes)
    return np.concatenate(points)


def box_f_score(boxes: Sequence[Box], reference: Sequence[Box], distance: float, count: int = 4096) -> float:
    """Return the F-score from 0 to 100 of two sets of boxes (Knapitsch et al. 2017).

    It is the harmonic mean of the shares of each surface within `distance` of the other. Points on one are measured
    against the exact surface of the other.
    """
    precision = float((surface_distance(even_surface_points(boxes, count), list(reference)) <= distance).mean())
    recall = float((surface_distance(even_surface_points(reference, count), list(boxes)) <= distance).mean())
    return 200 * precision * recall / (precision + recall) if precision + recall else 0.0


def is_rooted(boxes: Sequence[Box]) -> bool:
    """Return whether every box is connected to the ground through touching boxes."""
    corners = np.stack([corners_of_box(box) for box in boxes])
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
