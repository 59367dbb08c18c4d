"""The cameras of a sample.

Sines, products and sums are computed in a fixed order without the machine's libraries, and matrices are rounded, so
that the images of a sample are the same on every machine.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from stages.shape.arrays import FloatArray
from stages.shape.views.camera import View
from stages.shape.views.camera_record import CAMERA_DECIMALS
from stages.views.settings import (
    AnyCameras,
    Lens,
    OrbitLens,
    PosedCameras,
    RandomCameras,
    RingCameras,
    SphereCameras,
    ViewsConfig,
)

GOLDEN_ANGLE_DEGREES = 137.50776405003785
ORTHOGRAPHIC_DISTANCE_RADII = 3.0
MIN_FITTED_DISTANCE_RADII = 1.1
CLIP_MARGIN_RADII = 0.01
"""Free depth in front of and behind the bounding sphere, in its radii."""


class Sphere(NamedTuple):
    """A bounding sphere: middle, float64 (3,), and radius."""

    middle: FloatArray
    radius: float


class PictureFrame(NamedTuple):
    """What a picture holds.

    half_width, half_height: tangents of half the angles of view in perspective, else lengths in radii
    distance: depth of the middle of the shape, radii
    """

    half_width: float
    half_height: float
    distance: float
    perspective: bool


def sample_views(
    config: ViewsConfig, sphere: Sphere, rng_of: Callable[[int], np.random.Generator]
) -> list[tuple[str, View]]:
    """Return the kind and the view of each camera of a sample, in the order of the config.

    sphere: bounding sphere of the shape, y up
    rng_of: returns the random stream of an entry of `cameras`, by its index
    """
    return [
        (cameras.kind, _view(rotation, place, frame, sphere))
        for index, cameras in enumerate(config.cameras)
        for rotation, place, frame in _poses(cameras, config, rng_of(index))
    ]


def light_view(azimuth: float, elevation: float, sphere: Sphere) -> View:
    """Return the view from a distant light, whose square picture holds the bounding sphere; angles are in degrees."""
    rotation = orbit_rotation(azimuth, cosine_and_sine(elevation)[1])
    frame = PictureFrame(1.0, 1.0, ORTHOGRAPHIC_DISTANCE_RADII, False)
    return _view(rotation, ORTHOGRAPHIC_DISTANCE_RADII * rotation[2], frame, sphere)


def cosine_and_sine(degrees: float) -> tuple[float, float]:
    """Return cosine and sine of an angle, by their power series."""
    quarter = math.floor(degrees / 90.0 + 0.5)
    angle = (degrees - 90.0 * quarter) * (math.pi / 180.0)
    square, cosine, sine = angle * angle, 1.0, 1.0
    for k in range(17, 0, -2):
        cosine = 1.0 - square / (k * (k + 1)) * cosine
        sine = 1.0 - square / ((k + 1) * (k + 2)) * sine
    sine *= angle
    return ((cosine, sine), (-sine, cosine), (-cosine, -sine), (sine, -cosine))[quarter % 4]


def orbit_rotation(azimuth: float, height: float) -> FloatArray:
    """Return the rotation to eye space (3, 3) of a camera that looks at the middle of the shape.

    azimuth: degrees
    height: sine of the elevation

    Rows are right, up and backwards.
    """
    (ca, sa), ce = cosine_and_sine(azimuth), math.sqrt(max(1.0 - height * height, 0.0))
    return np.array([[ca, 0.0, -sa], [-height * sa, ce, -height * ca], [ce * sa, height, ce * ca]])


def _poses(
    cameras: AnyCameras, config: ViewsConfig, rng: np.random.Generator
) -> Iterator[tuple[FloatArray, FloatArray, PictureFrame]]:
    """Yield the rotation to eye space (3, 3), the place of the eye in radii from the middle (3,), and the frame."""
    if isinstance(cameras, PosedCameras):
        for pose in cameras.poses:
            matrix = np.array(pose)
            # OpenCV's y and z point the other way than those of eye space
            rotation = matrix[:3, :3].T * np.array([[1.0], [-1.0], [-1.0]])
            yield rotation, matrix[:3, 3], _frame(cameras, config, _dot(rotation[2], matrix[:3, 3]))
        return
    distance = _fitted_distance(cameras) if cameras.distance is None else cameras.distance
    frame = _frame(cameras, config, distance)
    for azimuth, height in _directions(cameras, rng):
        rotation = orbit_rotation(azimuth, height)
        yield rotation, distance * rotation[2], frame


def _directions(
    cameras: RingCameras | SphereCameras | RandomCameras, rng: np.random.Generator
) -> Iterator[tuple[float, float]]:
    """Yield azimuth in degrees and sine of the elevation of each camera."""
    if isinstance(cameras, RingCameras):
        for index in range(cameras.count):
            yield cameras.azimuth + 360.0 * index / cameras.count, cosine_and_sine(cameras.elevation)[1]
        return
    low, high = cosine_and_sine(cameras.min_elevation)[1], cosine_and_sine(cameras.max_elevation)[1]
    if isinstance(cameras, RandomCameras):
        for turn, share in rng.random((cameras.count, 2)).tolist():
            yield 360.0 * turn, low + (high - low) * share
        return
    start = 360.0 * float(rng.random()) if cameras.turned else 0.0
    for index in range(cameras.count):
        yield start + GOLDEN_ANGLE_DEGREES * index, low + (high - low) * (index + 0.5) / cameras.count


def _fitted_distance(cameras: OrbitLens) -> float:
    """Return the distance in radii at which the bounding sphere fits into the picture."""
    if cameras.projection == "orthographic":
        return ORTHOGRAPHIC_DISTANCE_RADII
    slope = _half_slope(cameras) * (1.0 - 2.0 * cameras.margin)
    return max(math.sqrt(1.0 + 1.0 / (slope * slope)), MIN_FITTED_DISTANCE_RADII)


def _frame(lens: Lens, config: ViewsConfig, distance: float) -> PictureFrame:
    if lens.projection == "perspective":
        shorter = _half_slope(lens)
    elif isinstance(lens, OrbitLens) and lens.distance is None:
        shorter = 1.0 / (1.0 - 2.0 * lens.margin)
    else:
        shorter = _half_slope(lens) * distance
    aspect = config.width / config.height
    return PictureFrame(
        shorter * max(aspect, 1.0), shorter * max(1.0 / aspect, 1.0), distance, lens.projection == "perspective"
    )


def _half_slope(lens: Lens) -> float:
    cosine, sine = cosine_and_sine(lens.fov / 2.0)
    return sine / cosine


def _view(rotation: FloatArray, place: FloatArray, frame: PictureFrame, sphere: Sphere) -> View:
    """Return the view of a camera, with a rounded eye matrix.

    rotation: rows right, up and backwards, (3, 3)
    place: of the eye, in radii from the middle, (3,)
    """
    radius, eye = sphere.radius, np.eye(4)
    eye[:3, :3] = np.round(rotation, CAMERA_DECIMALS)
    position = sphere.middle + radius * place
    eye[:3, 3] = np.round([-_dot(row, position) for row in eye[:3, :3]], CAMERA_DECIMALS)
    near = radius * (frame.distance - 1.0 - CLIP_MARGIN_RADII)
    far = radius * (frame.distance + 1.0 + CLIP_MARGIN_RADII)
    projection = np.zeros((4, 4))
    if frame.perspective:
        projection[0, 0], projection[1, 1] = 1.0 / frame.half_width, 1.0 / frame.half_height
        projection[2, 2], projection[2, 3] = -(far + near) / (far - near), -2.0 * far * near / (far - near)
        projection[3, 2] = -1.0
    else:
        projection[0, 0], projection[1, 1] = 1.0 / (radius * frame.half_width), 1.0 / (radius * frame.half_height)
        projection[2, 2], projection[2, 3] = -2.0 / (far - near), -(far + near) / (far - near)
        projection[3, 3] = 1.0
    return View(eye, projection, radius * frame.distance, radius)


def _dot(a: Sequence[float] | FloatArray, b: Sequence[float] | FloatArray) -> float:
    """Return the product of two vectors of three numbers, summed in their order."""
    return float(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])
