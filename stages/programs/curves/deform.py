"""Deformations of vertices, for `QuadMesh.deformed` and `Part.deformed` (geocode §3.1: expressions per vertex)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from stages.programs.curves.curve import Axis, Curve, axis_index
from stages.programs.curves.frames import rail_axes
from stages.shape.arrays import FloatArray

Deformation = Callable[[FloatArray], FloatArray]
"""From vertices (v, 3) to their new places (v, 3)."""


def taper(axis: Axis, start: float, end: float) -> Deformation:
    """Scales across an axis, from `start` where the mesh begins along it to `end` where it ends."""
    place = axis_index(axis)
    if not min(start, end) > 0.0:
        raise ValueError(f"a taper's scales are above 0, not {start:g} and {end:g}")

    def tapered(vertices: FloatArray) -> FloatArray:
        scale = start + (end - start) * _share(vertices, place)
        factors = np.repeat(scale[:, None], 3, axis=1)
        factors[:, place] = 1.0
        return vertices * factors

    return tapered


def twist(axis: Axis, degrees: float) -> Deformation:
    """Turns about an axis, from 0 where the mesh begins along it to `degrees` where it ends."""
    place = axis_index(axis)
    one, two = (place + 1) % 3, (place + 2) % 3

    def twisted(vertices: FloatArray) -> FloatArray:
        angles = np.radians(degrees) * _share(vertices, place)
        turned = vertices.copy()
        turned[:, one] = np.cos(angles) * vertices[:, one] - np.sin(angles) * vertices[:, two]
        turned[:, two] = np.sin(angles) * vertices[:, one] + np.cos(angles) * vertices[:, two]
        return turned

    return twisted


def bend(along: Axis, towards: Axis, degrees: float) -> Deformation:
    """Bends the mesh's extent along one axis into an arc of `degrees` that curves towards another axis.

    The middle stays; lengths at the mesh's middle plane stay. A mesh needs enough faces along the axis to bend.
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
    """Lays the mesh along an open rail: what runs along `axis` follows it, stretched to its length.

    The next two axes (of z: x and y) become those of the rail's frames, as in `sweep`.
    """
    place = axis_index(axis)
    if rail.closed:
        raise ValueError("a mesh follows an open rail: take a part() of this one")

    def laid(vertices: FloatArray) -> FloatArray:
        every, where = np.unique(
            np.concatenate([rail.positions, np.clip(_share(vertices, place), 0.0, 1.0)]), return_inverse=True
        )
        stations = rail.stations(every)
        x, y = rail_axes(stations.points, stations.tangents, every, False, None)
        at = where[len(rail.positions) :]
        across, up = vertices[:, [(place + 1) % 3]], vertices[:, [(place + 2) % 3]]
        followed: FloatArray = stations.points[at] + across * x[at] + up * y[at]
        return followed

    return laid


def _share(vertices: FloatArray, place: int) -> FloatArray:
    """Where each vertex lies between the mesh's ends along an axis, 0 to 1, (v,)."""
    along = vertices[:, place]
    low, high = along.min(), along.max()
    share: FloatArray = (along - low) / (high - low if high > low else 1.0)
    return share
