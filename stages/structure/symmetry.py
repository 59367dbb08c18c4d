"""Upright symmetries of a shape: rotations about the vertical and mirrors in vertical planes that map its parts onto
parts.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from stages.shape.arrays import BoolArray, FloatArray
from stages.shape.geometry.components import connected_components
from stages.shape.geometry.pose import transform_points
from stages.shape.geometry.triangles import triangle_areas
from stages.shape.shape import Shape

MAX_ROTATION_ORDER = 12
MIRROR_STEP_DEGREES = 7.5
"""Mirrors are tried at multiples of this angle, and where they map one part onto itself or another one."""
GAP_SHARE = 1e-3
"""Largest distance of vertices that are mapped onto each other, as a share of the diagonal of the shape."""
AREA_TOLERANCE = 1e-3
"""Relative difference of the areas of parts that are images of each other."""
ANGLE_DECIMALS = 3


@dataclass(frozen=True)
class Operation:
    """A symmetry of a shape.

    kind: rotation about the vertical axis, or mirror in a vertical plane through it
    degrees: angle of the rotation, or azimuth of the plane's normal, 0 along x and 90 along -z
    images: part that each part is mapped onto
    """

    kind: Literal["rotation", "mirror"]
    degrees: float
    images: tuple[int, ...]


@dataclass(frozen=True)
class Symmetry:
    """The upright symmetries of a shape.

    axis: x and z of the vertical axis
    operations: the identity first, then rotations, then mirrors, each by rising angle
    """

    axis: tuple[float, float]
    operations: tuple[Operation, ...]

    @cached_property
    def orbits(self) -> tuple[int, ...]:
        """The orbit of each part: parts that operations map onto each other have the same number."""
        count = len(self.operations[0].images)
        pairs = np.array([pair for found in self.operations for pair in enumerate(found.images)], dtype=np.int32)
        orbits = connected_components(count, pairs).tolist()
        number: dict[int, int] = {}
        return tuple(number.setdefault(orbit, len(number)) for orbit in orbits)


class _Parts:
    """The parts of a shape as sets of vertices: what is symmetric of them."""

    def __init__(self, shape: Shape) -> None:
        from scipy.spatial import cKDTree

        self.points: list[FloatArray] = []
        areas, middles = [], []
        for kind, pose in zip(shape.assembly.types.tolist(), shape.assembly.poses, strict=True):
            vertices = transform_points(pose, shape.meshes[kind].vertices)
            corners = vertices[shape.meshes[kind].faces]
            of_triangles = triangle_areas(corners)
            areas.append(float(of_triangles.sum()))
            middles.append((of_triangles[:, None] * corners.mean(axis=1)).sum(axis=0) / max(areas[-1], 1e-300))
            self.points.append(vertices)
        self.areas, self.middles = np.array(areas), np.array(middles)
        self.centre: FloatArray = self.areas @ self.middles / self.areas.sum()
        everything = np.concatenate(self.points)
        self.near = GAP_SHARE * float(np.linalg.norm(np.ptp(everything, axis=0)))
        self._trees = [cKDTree(points) for points in self.points]
        self.alike: BoolArray = (shape.part_labels[:, None] == shape.part_labels) & (
            np.abs(self.areas[:, None] - self.areas) <= AREA_TOLERANCE * self.areas
        )

    def images(self, matrix: FloatArray) -> tuple[int, ...] | None:
        """Return the part that each part is mapped onto by a matrix (3, 3) about the centre; None if one has none."""
        moved = (self.middles - self.centre) @ matrix.T + self.centre
        gaps = np.linalg.norm(moved[:, None] - self.middles, axis=2)
        candidates = self.alike & (gaps <= self.near)
        if not candidates.any(axis=1).all():
            return None
        images: list[int] = []
        for part, points in enumerate(self.points):
            turned = (points - self.centre) @ matrix.T + self.centre
            image = next(
                (other for other in np.flatnonzero(candidates[part]).tolist() if self._same(turned, other)), -1
            )
            if image < 0 or image in images:
                return None
            images.append(image)
        return tuple(images)

    def _same(self, points: FloatArray, other: int) -> bool:
        """Return whether points and the vertices of a part lie at the same places."""
        from scipy.spatial import cKDTree

        there = self._trees[other].query(points, distance_upper_bound=self.near)[0]
        back = cKDTree(points).query(self.points[other], distance_upper_bound=self.near)[0]
        return bool(np.isfinite(there).all() and np.isfinite(back).all())


def shape_symmetry(shape: Shape) -> Symmetry:
    """Return the upright symmetries of a shape, y up, whose axis is through the middle of its surface.

    Parts are compared by label, area and vertices, so that a symmetry that the triangles lack is not found. Rotations
    have an order of at most MAX_ROTATION_ORDER. Equal operations, of a part with more symmetry, are all listed.
    """
    parts = _Parts(shape)
    operations = [Operation("rotation", 0.0, tuple(range(len(shape))))]
    for degrees in _rotation_angles():
        images = parts.images(_rotation(degrees))
        if images is not None:
            operations.append(Operation("rotation", round(degrees, ANGLE_DECIMALS), images))
    for degrees in _mirror_angles(parts):
        images = parts.images(_mirror(degrees))
        if images is not None:
            operations.append(Operation("mirror", degrees, images))
    x, _, z = parts.centre.tolist()
    return Symmetry((x, z), tuple(operations))


def _rotation_angles() -> list[float]:
    shares = {step / order for order in range(2, MAX_ROTATION_ORDER + 1) for step in range(1, order)}
    return [360.0 * share for share in sorted(shares)]


def _mirror_angles(parts: _Parts) -> Iterator[float]:
    """Yield azimuths of normals, in degrees below 180: multiples of a step, and those of all mirrors of one part.

    Each mirror maps a part away from the axis onto itself or onto one that is alike. So the part with the fewest of
    these is enough, and a shape of n parts has at most n angles besides the multiples.
    """
    angles = set(np.arange(0.0, 180.0, MIRROR_STEP_DEGREES).tolist())
    away = parts.middles - parts.centre
    off_axis = np.flatnonzero(np.hypot(away[:, 0], away[:, 2]) > parts.near)
    if len(off_axis):
        part = off_axis[parts.alike[off_axis].sum(axis=1).argmin()]
        apart = parts.middles[part] - parts.middles[parts.alike[part]]
        level = (np.abs(apart[:, 1]) <= parts.near) & (np.hypot(apart[:, 0], apart[:, 2]) > parts.near)
        across = np.array([[-away[part, 2], 0.0, away[part, 0]]])
        normals = np.concatenate([apart[level], across])
        found = np.degrees(np.arctan2(-normals[:, 2], normals[:, 0])) % 180.0
        angles |= set((np.round(found, ANGLE_DECIMALS) % 180.0).tolist())
    kept: list[float] = []
    for angle in sorted(angles):
        if not kept or angle - kept[-1] > 10 ** (1 - ANGLE_DECIMALS):
            kept.append(angle)
    yield from kept


def _rotation(degrees: float) -> FloatArray:
    """Return the rotation about y, (3, 3)."""
    cosine, sine = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])


def _mirror(degrees: float) -> FloatArray:
    """Return the mirror in the vertical plane with a normal of this azimuth, (3, 3)."""
    normal = np.array([math.cos(math.radians(degrees)), 0.0, -math.sin(math.radians(degrees))])
    return np.eye(3) - 2.0 * np.outer(normal, normal)
