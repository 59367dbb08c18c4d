"""Contacts of boxes: attachment points from the shared volume, face centres preferred (shapeassembly App. C)."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shapeassembly.extraction.boxes import box_gap, corners_of_box, inside, local_points, world_points
from stages.shapeassembly.extraction.hierarchy import Box

END_BAND_SHARE = 0.05
"""Share of the height within which a part reaches the bottom or top of a bounding box."""

_GRID = np.array(list(product(np.linspace(0.0, 1.0, 15), repeat=3)))

_FACE_CENTERS = np.array([[0, 0.5, 0.5], [1, 0.5, 0.5], [0.5, 0, 0.5], [0.5, 1, 0.5], [0.5, 0.5, 0], [0.5, 0.5, 1]])
"""Local coordinates of the centres of left, right, bottom, top, back and front."""


@dataclass(frozen=True)
class Contact:
    """Two boxes in contact.

    first, second: (3,), the attachment point on each; they differ only across a gap.
    region: float64 (n, 3), points of the shared volume.
    """

    first: FloatArray
    second: FloatArray
    region: FloatArray


def contact_of(first: Box, second: Box, tolerance: float) -> Contact | None:
    """Return the contact of two boxes, or None if they are more than `tolerance` apart.

    The attachment point is the centre of the smaller of two opposite faces if both boxes reach it, else any face centre
    of one within the other, else the mean of the shared volume.
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
    """Return the point (3,) at which a box reaches the bottom or top of `bbox`, or None where it does not.

    The centre of the face in that direction is preferred.
    """
    edge = 1.0 if top else 0.0
    heights = local_points(bbox, corners_of_box(box))[:, 1]
    if np.abs(heights - edge).min() > END_BAND_SHARE:
        return None
    centers = world_points(box, _FACE_CENTERS)
    offset = np.abs(local_points(bbox, centers)[:, 1] - edge)
    if offset.min() <= END_BAND_SHARE:
        center: FloatArray = centers[int(offset.argmin())]
        return center
    points = world_points(box, _GRID)
    reaching = np.abs(local_points(bbox, points)[:, 1] - edge) <= END_BAND_SHARE
    if not reaching.any():
        points, reaching = corners_of_box(box), np.abs(heights - edge) <= END_BAND_SHARE
    mean: FloatArray = points[reaching].mean(axis=0)
    return mean


def _shared(first: Box, second: Box, tolerance: float) -> FloatArray:
    """Return points in both boxes, float64 (n, 3), from a grid over the overlap in the frame of either."""
    points_by_frame = []
    for own, other in ((first, second), (second, first)):
        corners = (corners_of_box(other) - own.center) @ own.axes.T
        half = own.size / 2
        low = np.clip(corners.min(axis=0) - tolerance, -half, half)
        high = np.clip(corners.max(axis=0) + tolerance, -half, half)
        points = own.center + (low + _GRID * (high - low)) @ own.axes
        points_by_frame.append(points[inside(other, points, tolerance)])
    most: FloatArray = points_by_frame[0] if len(points_by_frame[0]) >= len(points_by_frame[1]) else points_by_frame[1]
    return most


def _face_center(first: Box, second: Box, tolerance: float) -> FloatArray | None:
    """Return the face centre at which to attach, or None if no face centre of one box is in the other."""
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
    """Return whether face `index` of `own` is opposite a face of `other` within `tolerance` of its centre."""
    outward = own.axes[index // 2] * (1.0 if index % 2 else -1.0)
    local = other.axes @ (world_points(own, _FACE_CENTERS[index]) - other.center)
    facing = -(other.axes @ outward)
    axis = int(np.abs(facing).argmax())
    return bool(
        abs(facing[axis]) > 0.9 and abs(local[axis] - np.sign(facing[axis]) * other.size[axis] / 2) <= tolerance
    )


def _onto(box: Box, point: FloatArray) -> FloatArray:
    """Return the point of the box nearest to a point."""
    return world_points(box, np.clip(local_points(box, point), 0.0, 1.0))
