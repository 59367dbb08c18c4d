"""Geometry of oriented boxes: corners, places within them, the angles between them, how far apart they are."""

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
"""The 24 rotations that map coordinate axes onto coordinate axes, float64 (24, 3, 3)."""

_PROJECTIONS = 40
"""Most rounds of alternating projections; two settle boxes with parallel sides, tilted ones take about ten."""


def world_points(box: Box, place: FloatArray) -> FloatArray:
    """Points of the space around `box` at places (..., 3) in its own coordinates, 0 to 1 along each axis."""
    return box.center + ((place - 0.5) * box.size) @ box.axes


def local_points(box: Box, points: FloatArray) -> FloatArray:
    """The reverse of `world_points`; 0.5 along an axis in which the box has no size."""
    local = (points - box.center) @ box.axes.T
    return np.where(box.size > 1e-12, local / np.maximum(box.size, 1e-12), 0.0) + 0.5


def box_corners(box: Box) -> FloatArray:
    """The eight corners, float64 (8, 3)."""
    return world_points(box, UNIT_CORNERS)


def inside(box: Box, points: FloatArray, tolerance: float) -> BoolArray:
    """Which of the points (n, 3) lie in `box`, or beyond a side by at most `tolerance`."""
    local = np.abs((points - box.center) @ box.axes.T)
    within: BoolArray = np.all(local <= box.size / 2 + tolerance, axis=-1)
    return within


def bounding_box(points: FloatArray, axes: FloatArray) -> Box:
    """The smallest box with the given axes around points (n, 3)."""
    local = points @ axes.T
    low, high = local.min(axis=0), local.max(axis=0)
    return Box((low + high) / 2 @ axes, high - low, axes)


def mirror_points(points: FloatArray, center: FloatArray, axis: int) -> FloatArray:
    """Points (n, 3) reflected across the plane through `center` perpendicular to coordinate axis 0, 1 or 2."""
    flipped = points.copy()
    flipped[..., axis] = 2 * center[axis] - flipped[..., axis]
    return flipped


def nearest_axes(box: Box, frame: FloatArray) -> Box:
    """The same box with its axes renamed so that right, top and front are nearest those of `frame`, (3, 3)."""
    traces = np.einsum("kij,jl,il->k", _ROTATIONS, box.axes, frame)
    rotation = _ROTATIONS[int(traces.argmax())]
    return Box(box.center, np.abs(rotation) @ box.size, rotation @ box.axes)


def angle_between(axes: FloatArray, frame: FloatArray) -> float:
    """The angle in degrees by which `axes` (3, 3) are turned against `frame` (3, 3)."""
    return float(np.degrees(np.arccos(np.clip(((axes * frame).sum() - 1) / 2, -1.0, 1.0))))


def boxes_match(first: FloatArray, second: FloatArray, tolerance: float) -> bool:
    """Whether two sets of corners (8, 3), in any order, lie within `tolerance` of each other."""
    distances = np.linalg.norm(first[:, None] - second[None], axis=2)
    return bool(max(distances.min(axis=0).max(), distances.min(axis=1).max()) <= tolerance)


def box_gap(first: Box, second: Box) -> tuple[float, FloatArray, FloatArray]:
    """The distance of two solid boxes and the nearest point (3,) of each; 0 and one common point if they meet.

    By alternating projections, which approach the nearest pair of two convex bodies.
    """
    on_first, on_second = first.center, second.center
    distance = np.inf
    for _ in range(_PROJECTIONS):
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
    """For each point (n, 3) the exact distance to the nearest surface of any of the boxes, float64 (n,)."""
    nearest = np.full(len(points), np.inf)
    for box in boxes:
        beyond = np.abs((points - box.center) @ box.axes.T) - box.size / 2
        outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
        nearest = np.minimum(nearest, np.where(outside > 0, outside, -beyond.max(axis=1)))
    return nearest
