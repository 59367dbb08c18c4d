"""Geometry of oriented boxes: corners, local coordinates, angles, distances."""

from __future__ import annotations

from itertools import permutations, product

import numpy as np

from stages.shape.arrays import BoolArray, FloatArray
from stages.shapeassembly.extraction.hierarchy import Box

UNIT_CORNERS = np.array(list(product((0.0, 1.0), repeat=3)))

_ROTATIONS = np.array(
    [
        rotation
        for order in permutations(range(3))
        for signs in product((1.0, -1.0), repeat=3)
        if np.linalg.det(rotation := np.eye(3)[list(order)] * np.array(signs)[:, None]) > 0
    ]
)
"""The 24 rotations of the coordinate axes onto each other, float64 (24, 3, 3)."""

_MAX_PROJECTIONS = 40
"""Rounds of alternating projections; two suffice for parallel boxes, tilted ones take about ten."""


def world_points(box: Box, local: FloatArray) -> FloatArray:
    """Return the points at local coordinates (..., 3), 0 to 1 along each axis of the box."""
    return box.center + ((local - 0.5) * box.size) @ box.axes


def local_points(box: Box, points: FloatArray) -> FloatArray:
    """Return the local coordinates of points (..., 3); 0.5 along an axis without extent."""
    offset = (points - box.center) @ box.axes.T
    return np.where(box.size > 1e-12, offset / np.maximum(box.size, 1e-12), 0.0) + 0.5


def corners_of_box(box: Box) -> FloatArray:
    """Return the eight corners, float64 (8, 3)."""
    return world_points(box, UNIT_CORNERS)


def inside(box: Box, points: FloatArray, tolerance: float) -> BoolArray:
    """Return which of the points (n, 3) are in the box, or outside by at most `tolerance`."""
    offset = np.abs((points - box.center) @ box.axes.T)
    within: BoolArray = np.all(offset <= box.size / 2 + tolerance, axis=-1)
    return within


def bounding_box(points: FloatArray, axes: FloatArray) -> Box:
    """Return the smallest box with given axes around points (n, 3)."""
    local = points @ axes.T
    low, high = local.min(axis=0), local.max(axis=0)
    return Box((low + high) / 2 @ axes, high - low, axes)


def mirror_points(points: FloatArray, center: FloatArray, axis: int) -> FloatArray:
    """Reflect points (n, 3) across the plane through `center` perpendicular to a coordinate axis."""
    flipped = points.copy()
    flipped[..., axis] = 2 * center[axis] - flipped[..., axis]
    return flipped


def nearest_axes(box: Box, frame: FloatArray) -> Box:
    """Return the same box with its axes renamed to be nearest to those of `frame`, (3, 3)."""
    traces = np.einsum("kij,jl,il->k", _ROTATIONS, box.axes, frame)
    rotation = _ROTATIONS[int(traces.argmax())]
    return Box(box.center, np.abs(rotation) @ box.size, rotation @ box.axes)


def angle_between(axes: FloatArray, frame: FloatArray) -> float:
    """Return the angle in degrees between axes (3, 3) and a frame (3, 3)."""
    return float(np.degrees(np.arccos(np.clip(((axes * frame).sum() - 1) / 2, -1.0, 1.0))))


def boxes_match(first: FloatArray, second: FloatArray, tolerance: float) -> bool:
    """Return whether two sets of corners (8, 3), in any order, coincide within `tolerance`."""
    distances = np.linalg.norm(first[:, None] - second[None], axis=2)
    return bool(max(distances.min(axis=0).max(), distances.min(axis=1).max()) <= tolerance)


def box_gap(first: Box, second: Box) -> tuple[float, FloatArray, FloatArray]:
    """Return the distance of two solid boxes and the nearest point (3,) of each; 0 and a common point if they meet.

    Alternating projections converge to the nearest pair of points of two convex bodies.
    """
    on_first, on_second = first.center, second.center
    distance = np.inf
    for _ in range(_MAX_PROJECTIONS):
        on_second = _nearest_in(second, on_first)
        on_first = _nearest_in(first, on_second)
        before, distance = distance, float(np.linalg.norm(on_first - on_second))
        if distance >= before or distance == 0:
            break
    return distance, on_first, on_second


def _nearest_in(box: Box, point: FloatArray) -> FloatArray:
    local = box.axes @ (point - box.center)
    half = box.size / 2
    nearest: FloatArray = box.center + np.minimum(np.maximum(local, -half), half) @ box.axes
    return nearest


def surface_distance(points: FloatArray, boxes: list[Box]) -> FloatArray:
    """Return the exact distance of each point (n, 3) to the nearest surface of any box, float64 (n,)."""
    nearest = np.full(len(points), np.inf)
    for box in boxes:
        excess = np.abs((points - box.center) @ box.axes.T) - box.size / 2
        outside = np.linalg.norm(np.maximum(excess, 0.0), axis=1)
        nearest = np.minimum(nearest, np.where(outside > 0, outside, -excess.max(axis=1)))
    return nearest
