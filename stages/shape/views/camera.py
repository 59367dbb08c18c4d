"""Cameras: viewpoints, and the view and projection matrices that follow.

Matrices are OpenGL's: the eye looks along -z of eye space, x points right and y up; clip depth runs from -1 (near) to 1
(far).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from stages.shape.arrays import FloatArray

MIN_DISTANCE_RADII = 1.05
"""Nearest allowed eye in radii of the bounding sphere: the whole shape stays in front of the eye."""


@dataclass(frozen=True)
class View:
    """A camera pointed at one shape.

    eye: world to eye space, float64 (4, 4)
    projection: eye to clip space, float64 (4, 4)
    depth: distance from the eye to the middle of the shape, world units
    radius: radius of the shape's bounding sphere, world units
    """

    eye: FloatArray
    projection: FloatArray
    depth: float
    radius: float

    @property
    def perspective(self) -> bool:
        """Whether the projection is perspective."""
        return bool(self.projection[3, 3] == 0.0)


@dataclass(frozen=True)
class Camera:
    """A viewpoint.

    azimuth: degrees; 0 looks at the front (from +z if y is up, from -y if z is up), growing towards +x
    elevation: degrees; 90 looks straight down
    projection: kind of projection
    fov: full angle of the shorter image side, degrees
    distance: from the eye to the middle of the shape in radii of its bounding sphere, at least 1.05; None moves the eye
        and centres the shape so that it fills the frame
    margin: share of the frame left free on each side if `distance` is not set
    """

    azimuth: float
    elevation: float
    projection: Literal["perspective", "orthographic"] = "perspective"
    fov: float = 30.0
    distance: float | None = None
    margin: float = 0.06

    def look(self, points: FloatArray, up: Literal["y", "z"], aspect: float = 1.0) -> View:
        """Point the camera at a shape.

        points: points whose hull contains the shape, (n, 3)
        aspect: width / height

        Raises ValueError for no points, and for a distance that puts the eye inside the shape.
        """
        if len(points) == 0:
            raise ValueError("a camera needs at least one point to look at")
        if self.distance is not None and self.distance < MIN_DISTANCE_RADII:
            raise ValueError(
                f"camera distance {self.distance} is inside the shape; at least {MIN_DISTANCE_RADII} radii"
            )
        # Along rows of coordinates numpy reduces several times as fast as along columns.
        rows = np.ascontiguousarray(points.T)
        middle = (rows.min(axis=1) + rows.max(axis=1)) / 2
        turned = np.ascontiguousarray(((points - middle) @ eye_rotation(self.azimuth, self.elevation, up).T).T)
        radius = float(np.sqrt((turned**2).sum(axis=0).max())) or 1.0
        slope = np.tan(np.radians(self.fov) / 2)
        half = slope * np.array([max(aspect, 1.0), max(1.0 / aspect, 1.0)])
        if self.projection == "perspective":
            shift, depth = self._perspective_frame(turned, half, radius)
            frame = 1.0 / half
        else:
            shift, extent = self._orthographic_frame(turned, half / slope, radius, slope)
            depth, frame = 3.0 * radius, 1.0 / extent
        eye = np.eye(4)
        eye[:3, :3] = eye_rotation(self.azimuth, self.elevation, up)
        eye[:3, 3] = -eye[:3, :3] @ middle - [shift[0], shift[1], depth]
        depths = depth - turned[2]
        slack = 0.01 * radius
        near, far = max(float(depths.min()) - slack, 0.005 * radius), float(depths.max()) + slack
        return View(eye, _projection(self.projection, frame, near, far), depth, radius)

    def _perspective_frame(self, turned: FloatArray, half: FloatArray, radius: float) -> tuple[FloatArray, float]:
        """Return the sideways shift (2,) and the distance of the eye.

        turned: coordinates of the points along the axes of the eye, (3, n)
        half: tangents of half the angles of both sides
        """
        if self.distance is not None:
            return np.zeros(2), self.distance * radius
        inner = half * (1.0 - 2.0 * self.margin)
        # A point stays left of the right border exactly if x - shift <= (depth - z) * inner, and so on.
        nearer = turned[2] * inner[:, None]
        right, left = (turned[:2] + nearer).max(axis=1), (nearer - turned[:2]).max(axis=1)
        depth = max(float(((right + left) / (2 * inner)).max()), float(turned[2].max()) + 0.05 * radius)
        return (right - left) / 2, depth

    def _orthographic_frame(
        self, turned: FloatArray, sides: FloatArray, radius: float, slope: float
    ) -> tuple[FloatArray, FloatArray]:
        """Return the sideways shift (2,) and half extents (2,) of the frame.

        turned: coordinates of the points along the axes of the eye, (3, n)
        """
        if self.distance is not None:
            return np.zeros(2), sides * self.distance * radius * slope
        high, low = turned[:2].max(axis=1), turned[:2].min(axis=1)
        needed = (high - low) / 2 / sides / (1.0 - 2.0 * self.margin)
        return (high + low) / 2, sides * max(float(needed.max()), 1e-9 * radius)


def eye_rotation(azimuth: float, elevation: float, up: Literal["y", "z"]) -> FloatArray:
    """Return the rotation (3, 3) from world to eye axes. Rows are right, up and backwards; angles are in degrees."""
    a, e = np.radians(azimuth), np.radians(elevation)
    right = [np.cos(a), 0.0, -np.sin(a)]
    above = [-np.sin(e) * np.sin(a), np.cos(e), -np.sin(e) * np.cos(a)]
    back = [np.cos(e) * np.sin(a), np.sin(e), np.cos(e) * np.cos(a)]
    rotation = np.array([right, above, back])
    if up == "z":
        # World (x, y, z) with z up is (x, z, -y) with y up.
        rotation = np.stack([rotation[:, 0], -rotation[:, 2], rotation[:, 1]], axis=1)
    return rotation


def _projection(kind: Literal["perspective", "orthographic"], frame: FloatArray, near: float, far: float) -> FloatArray:
    """Return the clip matrix (4, 4).

    frame: scales eye x and y (per unit of depth in perspective) to -1..1, (2,)
    """
    projection = np.zeros((4, 4))
    projection[0, 0], projection[1, 1] = frame
    if kind == "perspective":
        projection[2, 2], projection[2, 3] = -(far + near) / (far - near), -2.0 * far * near / (far - near)
        projection[3, 2] = -1.0
    else:
        projection[2, 2], projection[2, 3] = -2.0 / (far - near), -(far + near) / (far - near)
        projection[3, 3] = 1.0
    return projection
