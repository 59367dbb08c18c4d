"""Deformations of vertices, for `QuadMesh.deformed` and `Part.deformed` (geocode §3.1: expressions per vertex)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from stages.programs.curves.curve import Axis, Curve, axis_index
from stages.programs.curves.frames import rail_axes
from stages.shape.arrays import FloatArray

Deformation = Callable[[FloatArray], FloatArray]
"""From vertices (v, 3) to their new positions (v, 3)."""


def taper(axis: Axis, start: float, end: float) -> Deformation:
    """Scale across an axis, from `start` at the lower end of the mesh to `end` at its upper end."""
    index = axis_index(axis)
    if not min(start, end) > 0.0:
        raise ValueError(f"a taper's scales are above 0, not {start:g} and {end:g}")

    def tapered(vertices: FloatArray) -> FloatArray:
        scale = start + (end - start) * _share(vertices, index)
        factors = np.repeat(scale[:, None], 3, axis=1)
        factors[:, index] = 1.0
        return vertices * factors

    return tapered


def twist(axis: Axis, degrees: float) -> Deformation:
    """Turn about an axis, from 0 at the lower end of the mesh to `degrees` at its upper end."""
    index = axis_index(axis)
    first, second = (index + 1) % 3, (index + 2) % 3

    def twisted(vertices: FloatArray) -> FloatArray:
        angles = np.radians(degrees) * _share(vertices, index)
        turned = vertices.copy()
        turned[:, first] = np.cos(angles) * vertices[:, first] - np.sin(angles) * vertices[:, second]
        turned[:, second] = np.sin(angles) * vertices[:, first] + np.cos(angles) * vertices[:, second]
        return turned

    return twisted


def bend(along: Axis, towards: Axis, degrees: float) -> Deformation:
    """Bend the mesh along one axis into an arc of `degrees` that curves towards another axis.

    Its middle and the lengths in its middle plane are kept. A mesh needs enough faces along the axis to bend.
    """
    first, second = axis_index(along), axis_index(towards)
    if first == second:
        raise ValueError(f"a mesh along {along} bends towards another axis")
    if abs(degrees) < 1e-6:
        return np.copy

    def bent(vertices: FloatArray) -> FloatArray:
        low, high = vertices[:, first].min(), vertices[:, first].max()
        middle, level = (low + high) / 2.0, (vertices[:, second].min() + vertices[:, second].max()) / 2.0
        radius = (high - low) / np.radians(degrees)
        angles = (vertices[:, first] - middle) / radius
        reach = radius - (vertices[:, second] - level)
        curved = vertices.copy()
        curved[:, first] = middle + reach * np.sin(angles)
        curved[:, second] = level + radius - reach * np.cos(angles)
        return curved

    return bent


def follow(rail: Curve, axis: Axis = "z") -> Deformation:
    """Lay the mesh along an open rail: its extent along `axis` is stretched to the length of the rail.

    The next two axes (after z: x and y) become those of the rail's frames, as in `sweep`.
    """
    index = axis_index(axis)
    if rail.closed:
        raise ValueError("a mesh follows an open rail: take a part() of this one")

    def laid(vertices: FloatArray) -> FloatArray:
        positions, inverse = np.unique(
            np.concatenate([rail.positions, np.clip(_share(vertices, index), 0.0, 1.0)]), return_inverse=True
        )
        stations = rail.stations(positions)
        x, y = rail_axes(stations.points, stations.tangents, positions, False, None)
        at = inverse[len(rail.positions) :]
        across, up = vertices[:, [(index + 1) % 3]], vertices[:, [(index + 2) % 3]]
        followed: FloatArray = stations.points[at] + across * x[at] + up * y[at]
        return followed

    return laid


def _share(vertices: FloatArray, index: int) -> FloatArray:
    """Relative position of each vertex between the ends of the mesh along an axis, 0 to 1, (v,)."""
    along = vertices[:, index]
    low, high = along.min(), along.max()
    share: FloatArray = (along - low) / (high - low if high > low else 1.0)
    return share
