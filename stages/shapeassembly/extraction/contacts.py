"""Where boxes touch: attachment points by intersected volumes, face centres preferred (shapeassembly App. C)."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shapeassembly.extraction.boxes import box_corners, box_gap, inside, local_points, world_points
from stages.shapeassembly.extraction.hierarchy import Box

END_BAND_SHARE = 0.05
"""Share of the height of a bounding box within which a part reaches its bottom or its top."""

_GRID = np.array(list(product(np.linspace(0.0, 1.0, 15), repeat=3)))

_FACE_CENTERS = np.array([[0, 0.5, 0.5], [1, 0.5, 0.5], [0.5, 0, 0.5], [0.5, 1, 0.5], [0.5, 0.5, 0], [0.5, 0.5, 1]])
"""Centres of left, right, bottom, top, back and front in a box's own coordinates."""


@dataclass(frozen=True)
class Contact:
    """Two boxes in contact. first, second: the attachment point (3,) on each, the same but where a gap was bridged.
    region: float64 (n, 3), points of the volume in which both are."""

    first: FloatArray
    second: FloatArray
    region: FloatArray


def contact_of(first: Box, second: Box, tolerance: float) -> Contact | None:
    """How two boxes touch, or None if they are more than `tolerance` apart.

    Where a face of one lies against the other, the centre of the smaller such face is the attachment point if both
    boxes reach it; then any face centre of one within the other; else the mean of the volume that both fill.
    """
    reach = (np.linalg.norm(first.size) + np.linalg.norm(second.size)) / 2 + tolerance
    if np.linalg.norm(first.center - second.center) > reach:
        return None
    distance, on_first, on_second = box_gap(first, second)
    if distance > tolerance:
        return None
    region = _shared(first, second, max(distance, 1e-6))
    if not len(region):
        region = np.stack([on_first, on_second])
    point = _face_center(first, second, tolerance)
    if point is None:
        point = region.mean(axis=0)
    return Contact(_onto(first, point), _onto(second, point), region)


def bottom_or_top(box: Box, bbox: Box, *, top: bool) -> FloatArray | None:
    """The point (3,) at which `box` reaches the bottom or the top of `bbox`, a box that stands along its axes.

    None if nothing of it lies within a twentieth of the height. The centre of the face that looks there is preferred.
    """
    edge = 1.0 if top else 0.0
    heights = local_points(bbox, box_corners(box))[:, 1]
    if np.abs(heights - edge).min() > END_BAND_SHARE:
        return None
    centers = world_points(box, _FACE_CENTERS)
    away = np.abs(local_points(bbox, centers)[:, 1] - edge)
    if away.min() <= END_BAND_SHARE:
        found: FloatArray = centers[int(away.argmin())]
        return found
    points = world_points(box, _GRID)
    near = np.abs(local_points(bbox, points)[:, 1] - edge) <= END_BAND_SHARE
    if not near.any():
        points, near = box_corners(box), np.abs(heights - edge) <= END_BAND_SHARE
    mean: FloatArray = points[near].mean(axis=0)
    return mean


def _shared(first: Box, second: Box, tolerance: float) -> FloatArray:
    """Points that lie in both boxes, float64 (n, 3), from a grid over the overlap in the frame of either."""
    found = []
    for own, other in ((first, second), (second, first)):
        corners = (box_corners(other) - own.center) @ own.axes.T
        half = own.size / 2
        low = np.clip(corners.min(axis=0) - tolerance, -half, half)
        high = np.clip(corners.max(axis=0) + tolerance, -half, half)
        points = own.center + (low + _GRID * (high - low)) @ own.axes
        found.append(points[inside(other, points, tolerance)])
    more: FloatArray = found[0] if len(found[0]) >= len(found[1]) else found[1]
    return more


def _face_center(first: Box, second: Box, tolerance: float) -> FloatArray | None:
    """The face centre at which to attach, or None if no face centre of one box lies in the other."""
    best: FloatArray | None = None
    best_rank = (2, np.inf)
    for own, other in ((first, second), (second, first)):
        centers = world_points(own, _FACE_CENTERS)
        for index in np.flatnonzero(inside(other, centers, tolerance)):
            axis = int(index) // 2
            area = float(np.prod(np.delete(own.size, axis)))
            rank = (0 if _faces(own, other, int(index), tolerance) else 1, area)
            if rank < best_rank:
                best, best_rank = centers[index], rank
    return best


def _faces(own: Box, other: Box, index: int, tolerance: float) -> bool:
    """Whether face `index` of `own` looks against a face of `other` that lies within `tolerance` of its centre."""
    outward = own.axes[index // 2] * (1.0 if index % 2 else -1.0)
    local = other.axes @ (world_points(own, _FACE_CENTERS[index]) - other.center)
    facing = -(other.axes @ outward)
    axis = int(np.abs(facing).argmax())
    return bool(
        abs(facing[axis]) > 0.9 and abs(local[axis] - np.sign(facing[axis]) * other.size[axis] / 2) <= tolerance
    )


def _onto(box: Box, point: FloatArray) -> FloatArray:
    """The point of the box nearest to `point`."""
    return world_points(box, np.clip(local_points(box, point), 0.0, 1.0))
